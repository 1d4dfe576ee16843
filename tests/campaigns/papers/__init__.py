"""The three papers beside this program: every item with a published value, ours and a verdict."""
