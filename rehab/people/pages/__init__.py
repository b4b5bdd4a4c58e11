"""The pages about people: front page, sign-in, account, consent."""
