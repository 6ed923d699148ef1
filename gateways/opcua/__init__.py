"""`handeyed opcua`: N cells as vision systems, modelled on OPC 40100-1, and each as a flat folder of scalars."""
