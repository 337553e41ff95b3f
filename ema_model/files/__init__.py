"""Files of users: opened, limited, taken apart safely, written whole, locked."""
