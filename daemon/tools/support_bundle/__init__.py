"""What a remote engineer needs to understand a cell, in one file, without anything secret."""
