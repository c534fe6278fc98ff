"""What a training file and a sweep file may say."""
