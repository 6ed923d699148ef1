"""Robot Web Services 1.0 (IRC5) and 2.0 (OmniCore) of the mock controller, as strict as real controllers."""
