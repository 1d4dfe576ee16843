"""The three papers next to this program: every item with a published value, ours and a verdict."""
