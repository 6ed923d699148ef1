"""An ABB controller over Robot Web Services 1.0 (IRC5) or 2.0 (OmniCore): reading and stopping, never motion."""
