m.mav.command_long_send(1,1,400,0,0,0,0,0,0,0,0)
