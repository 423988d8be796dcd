"""The program as a page of a browser; see docs/explorer.md."""
