"""A customer's program with EGM: a client chooses by gi_guidance what the sensor guides, and ends it by do_enough."""

SIGNALS = """EIO:CFG_1.0:6:1::
#
EIO_SIGNAL:

      -Name "gi_guidance" -SignalType "GI"
      -Name "di_begin" -SignalType "DI"
      -Name "do_enough" -SignalType "DO"
"""
PROGRAM = """MODULE seam_follower
  CONST egm_minmax near := [-0.1, 0.1];
  CONST pose unmoved := [[0, 0, 0], [1, 0, 0, 0]];
  CONST jointtarget ready := [[10, 15, 0, 30, 65, 30], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]];
  PERS bool was_guided := FALSE;
  PERS bool ended := FALSE;
  PERS string kind := "";
  VAR egmident sensor;
  VAR robtarget seam_begins;
  VAR robtarget seam_ends;

  PROC main()
    WaitUntil di_begin = 1 \\PollRate:=0.04;
    SetDO do_enough, 0;
    MoveAbsJ ready, v1000, fine, tool0 \\WObj:=wobj0;
    seam_begins := CRobT(\\Tool:=tool0 \\WObj:=wobj0);
    seam_ends := seam_begins;
    seam_ends.trans.y := seam_begins.trans.y + 100;
    EGMReset sensor;
    EGMGetId sensor;
    TEST gi_guidance
    CASE 1:
      follow_joints;
    CASE 2:
      follow_tool;
    CASE 3:
      follow_seam;
    DEFAULT:
      report_positions;
    ENDTEST
    EGMReset sensor;
    TPWrite kind \\Bool:=was_guided;
    ended := TRUE;
    WaitTime 1000;
  ENDPROC

  PROC report_positions()
    kind := "positions ";
    EGMSetupUC ROB_1, sensor, "default", "UCdevice" \\Joint;
    EGMStreamStart sensor \\SampleRate:=8;
    WaitDO do_enough, 1;
    MoveJ seam_begins, v1000, z100, tool0 \\WObj:=wobj0;
    MoveL seam_ends, v1000, fine, tool0 \\WObj:=wobj0;
    EGMStreamStop sensor;
  ENDPROC

  PROC follow_joints()
    kind := "joints ";
    EGMSetupUC ROB_1, sensor, "default", "UCdevice" \\Joint \\CommTimeout:=20;
    EGMActJoint sensor \\J1:=near \\MaxSpeedDeviation:=30;
    EGMRunJoint sensor, EGM_STOP_HOLD \\NoWaitCond \\J1;
    leave_when_told;
  ENDPROC

  PROC follow_tool()
    kind := "tool ";
    EGMSetupUC ROB_1, sensor, "default", "UCdevice" \\Pose \\CommTimeout:=20;
    EGMActPose sensor \\Tool:=tool0 \\WObj:=wobj0, unmoved, EGM_FRAME_WOBJ, unmoved, EGM_FRAME_WOBJ
      \\y:=near \\MaxSpeedDeviation:=30;
    EGMRunPose sensor, EGM_STOP_HOLD \\NoWaitCond \\y;
    leave_when_told;
  ENDPROC

  PROC follow_seam()
    kind := "seam ";
    EGMSetupUC ROB_1, sensor, "default", "UCdevice" \\PathCorr \\APTR;
    EGMActMove sensor, unmoved \\SampleRate:=8;
    WaitDO do_enough, 1;
    EGMMoveL sensor, seam_ends, v10, fine, tool0 \\WObj:=wobj0;
  ENDPROC

  PROC leave_when_told()
    VAR egmstate state;
    state := EGMGetState(sensor);
    was_guided := state = EGM_STATE_RUNNING;
    WaitDO do_enough, 1;
    EGMStop sensor, EGM_STOP_HOLD;
  ENDPROC
ENDMODULE
"""
