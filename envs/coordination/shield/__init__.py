"""The shield: lets through only commands after which all arms can still stop and go on."""
