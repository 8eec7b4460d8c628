"""Launch files, vehicle files and the command line tool."""
