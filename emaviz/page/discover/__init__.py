"""The Discover tab and its panels."""
