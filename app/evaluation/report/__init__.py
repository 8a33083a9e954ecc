"""What people read: figures, tables, a verdict, one page of HTML."""
