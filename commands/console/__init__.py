"""What commands share: output, tables, options."""
