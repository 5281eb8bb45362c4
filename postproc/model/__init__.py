"""The accuracy model: effects, their sum, what it predicts and how surely."""
