"""Sessions for analysis, by pseudonyms: tables, Parquet, recordings, BIDS and FHIR."""
