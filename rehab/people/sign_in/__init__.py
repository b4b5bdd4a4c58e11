"""Signing in: passwords, second factors, passkeys, tokens, lockout, browser sessions."""
