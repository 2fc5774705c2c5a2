"""reports: pages rendered from stored records; nothing here simulates except the study it starts."""
