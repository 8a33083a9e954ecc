"""One module a console subcommand; `app.cli` only wires them."""
