"""Roads from drives: cleaning, the roads that appear, and which road a drive follows where."""
