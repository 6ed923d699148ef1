MODULE CELL_main
  ! The motion task has nothing else to do: its main serves the link for ever. Leave this module out where a program of
  ! yours has the main; it calls cell_motion where the arm may leave its work.
  PROC main()
    cell_obey TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC
ENDMODULE
