"""How each language writes dates and times: one style on all pages, those of the admin too."""
