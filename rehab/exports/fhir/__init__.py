"""Sessions as HL7 FHIR: one mapping, for research exports, the API, and what is sent to servers."""
