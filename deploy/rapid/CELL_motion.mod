MODULE CELL_motion
  ! The motion task (T_ROB1): one move at a time, stopped by cell_abort when cell_bell changes, and when the
  ! communication task shows no life for CELL_WATCHES times CELL_WATCH_S.
  CONST num CELL_WATCH_S := 0.25;
  CONST num CELL_WATCHES := 8;

  VAR intnum cell_abort_intno;
  VAR intnum cell_watch_intno;
  VAR num cell_life_seen := 0;
  VAR num cell_misses := 0;

  PROC main()
    ! No interrupt until the arm stands and the abort is answered: it would restart the wait again and again.
    IDelete cell_abort_intno;
    IDelete cell_watch_intno;
    CONNECT cell_watch_intno WITH cell_watch_trap;
    ITimer CELL_WATCH_S, cell_watch_intno;
    cell_misses := 0;
    cell_beat := (cell_beat MOD 1000) + 1;
    ConfJ \On;
    ConfL \On;
    SingArea \Off;
    VelSet 100, 1000;
    cell_settled := FALSE;
    WaitTime \InPos, 0.3;
    cell_moving := FALSE;
    cell_settled := TRUE;
    IF cell_abort THEN
      cell_request := FALSE;
      cell_done_status := cell_abort_status;
      cell_done := TRUE;
      cell_abort := FALSE;
    ENDIF
    CONNECT cell_abort_intno WITH cell_abort_trap;
    IPers cell_bell, cell_abort_intno;
    WHILE TRUE DO
      WaitUntil cell_request OR cell_abort \PollRate:=0.04;
      IF cell_abort ExitCycle;
      cell_request := FALSE;
      cell_one_move;
    ENDWHILE
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_one_move()
    VAR errnum reach := 0;
    VAR speeddata speed;
    VAR num limit := 0;
    cell_from_joints := CJointT();
    cell_goal_joints := CalcJointT(cell_goal, cell_flange \WObj:=wobj0 \ErrorNumber:=reach);
    IF reach <> 0 THEN
      cell_verdict := CB_UNREACHABLE;
      RETURN;
    ENDIF
    limit := cell_goal_speed;
    IF OpMode() <> OP_AUTO AND limit > 250 limit := 250;
    ! A joint move travels and turns unevenly.
    IF cell_goal_kind <> 2 limit := 0.8 * limit;
    speed := cell_speed(limit);
    cell_settled := FALSE;
    cell_moving := TRUE;
    cell_verdict := CB_ACCEPTED;
    IF cell_goal_kind = 2 THEN
      MoveL cell_goal, speed, fine, cell_flange \WObj:=wobj0;
    ELSE
      MoveJ cell_goal, speed, fine, cell_flange \WObj:=wobj0;
    ENDIF
    cell_moving := FALSE;
    WaitTime \InPos, 0.3;
    cell_settled := TRUE;
    cell_done_status := CB_OK;
    cell_done := TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  FUNC speeddata cell_speed(num limit)
    ! Travel and turn of the flange share the limit (mm/s) as the way to the goal does: v_tcp plus v_ori times cell_reach is limit.
    VAR robtarget here;
    VAR num dot := 0;
    VAR num arm := 1;
    VAR num way := 0;
    VAR num sweep := 0;
    VAR num share := 0.9;
    VAR num turn := 0;
    IF cell_reach > 1 arm := cell_reach;
    here := CRobT(\Tool:=tool0 \WObj:=wobj0);
    dot := here.rot.q1 * cell_goal.rot.q1 + here.rot.q2 * cell_goal.rot.q2;
    dot := Abs(dot + here.rot.q3 * cell_goal.rot.q3 + here.rot.q4 * cell_goal.rot.q4);
    IF dot > 1 dot := 1;
    way := Distance(here.trans, cell_goal.trans);
    sweep := arm * 2 * ACos(dot) * pi / 180;
    IF way + sweep > 0.001 share := way / (way + sweep);
    IF share > 0.9 share := 0.9;
    IF share < 0.25 share := 0.25;
    turn := (1 - share) * limit / arm * 180 / pi;
    RETURN [share * limit, turn, limit, turn];
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  TRAP cell_abort_trap
    ! ExitCycle stops the movement, clears the path and starts main again.
    IF cell_abort ExitCycle;
  ERROR
    SkipWarn;
    TRYNEXT;
  ENDTRAP

  TRAP cell_watch_trap
    ! Show life to the communication task. When that one stands still, nobody could stop the move: end it here.
    cell_beat := (cell_beat MOD 1000) + 1;
    cell_misses := cell_misses + 1;
    IF (NOT cell_moving) OR cell_life <> cell_life_seen cell_misses := 0;
    cell_life_seen := cell_life;
    IF cell_misses >= CELL_WATCHES THEN
      cell_armed := FALSE;
      IF NOT cell_abort cell_abort_status := CB_ABORTED;
      cell_abort := TRUE;
      ErrWrite \W, "handeyed", "the communication task shows no life: the move is ended";
      ExitCycle;
    ENDIF
  ERROR
    SkipWarn;
    TRYNEXT;
  ENDTRAP
ENDMODULE
