"""Methods of single chapters: distributions, several experts, planning, a trainer."""
