"""What all verbs share: tables and JSON, output files, progress, display names, groups of verbs."""
