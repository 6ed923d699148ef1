MODULE CELL_egm
  ! Optional, with Externally Guided Motion (IRC5 689-1, RobotWare 6.07.01 and later; OmniCore 3124-1): position streams
  ! to the PC while cell_motion serves it. Call cell_motion_egm in place of cell_motion; in CELL_main write
  ! cell_obey_egm TRUE in place of cell_obey TRUE. The device is that of egm/SIO.cfg.
  CONST string CELL_EGM_DEVICE := "handeyed";
  ! Milliseconds between two packets, a multiple of 4.
  CONST num CELL_EGM_RATE := 4;

  VAR egmident cell_egm_id;

  PROC cell_motion_egm()
    cell_obey_egm FALSE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_obey_egm(bool stays)
    IF NOT (stays OR cell_wanted OR cell_abort) RETURN;
    ! An identity that an earlier run left is released first: there are few of them.
    EGMReset cell_egm_id;
    EGMGetId cell_egm_id;
    EGMSetupUC ROB_1, cell_egm_id, "default", CELL_EGM_DEVICE \Pose;
    EGMStreamStart cell_egm_id \SampleRate:=CELL_EGM_RATE;
    cell_obey stays;
    EGMStreamStop cell_egm_id;
    EGMReset cell_egm_id;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC
ENDMODULE
