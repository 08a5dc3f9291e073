"""Buildings of few facts, and tables of them: rules derive their stories."""
