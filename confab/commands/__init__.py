"""The commands by their purpose; `confab.cli` has the table of them."""
