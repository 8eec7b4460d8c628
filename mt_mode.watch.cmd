m.mav.command_long_send(1,1,176,0,1,0,0,0,0,0,0)
