"""What a cell file may say."""
