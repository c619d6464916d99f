"""The program: its start, its windows' life, menus, keys, theme and preferences."""
