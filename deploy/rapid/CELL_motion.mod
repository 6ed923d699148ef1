MODULE CELL_motion
  ! The motion task: one move at a time, stopped by cell_abort when cell_bell changes, and when the communication
  ! task shows no life for CELL_WATCHES times CELL_WATCH_S. The main of CELL_main, or one of yours, calls it:
  ! outside of cell_motion no trap of it runs and no setting of it holds.
  CONST num CELL_WATCH_S := 0.25;
  CONST num CELL_WATCHES := 8;

  VAR errnum CELL_ERR_ABORT := -1;
  VAR intnum cell_abort_intno;
  VAR intnum cell_watch_intno;
  VAR num cell_life_seen := 0;
  VAR num cell_misses := 0;
  VAR bool cell_drives := FALSE;
  ! What holds in the program that calls cell_motion, restored at its end.
  VAR motsetdata cell_old_set;
  VAR string cell_old_tool := "";
  VAR string cell_old_wobj := "";
  VAR string cell_old_load := "";
  VAR confdata cell_near;
  PERS tooldata cell_any_tool := [TRUE, [[0, 0, 0], [1, 0, 0, 0]], [0.001, [0, 0, 0.001], [1, 0, 0, 0], 0, 0, 0]];
  PERS wobjdata cell_any_wobj := [FALSE, TRUE, "", [[0, 0, 0], [1, 0, 0, 0]], [[0, 0, 0], [1, 0, 0, 0]]];
  PERS loaddata cell_any_load := [0.001, [0, 0, 0.001], [1, 0, 0, 0], 0, 0, 0];

  PROC cell_motion()
    ! Call it where the arm may leave its work: returns at once when no client wants the arm, otherwise when it has gone.
    cell_obey FALSE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_obey(bool stays)
    IF NOT (stays OR cell_wanted OR cell_abort) RETURN;
    IF CELL_ERR_ABORT = -1 BookErrNo CELL_ERR_ABORT;
    cell_enter;
    WHILE stays OR cell_wanted OR cell_abort DO
      cell_settle;
      cell_moves stays;
    ENDWHILE
    cell_leave;
  ERROR (CELL_ERR_ABORT)
    ! Whether a listed clause takes other errors, too, is in no manual: they go on to the caller.
    IF ERRNO <> CELL_ERR_ABORT RAISE;
    ! A trap has stopped the arm and cleared its path: settle and answer the abort.
    SkipWarn;
    TRYNEXT;
  UNDO
    ! ExitCycle, or the program pointer moved away: nothing of ours stays behind.
    IDelete cell_abort_intno;
    IDelete cell_watch_intno;
    IF cell_serves cell_leave;
  ENDPROC

  PROC cell_enter()
    cell_old_set := C_MOTSET;
    GetSysData cell_any_tool \ObjectName:=cell_old_tool;
    GetSysData cell_any_wobj \ObjectName:=cell_old_wobj;
    GetSysData cell_any_load \ObjectName:=cell_old_load;
    GripLoad load0;
    ConfJ \On;
    ConfL \On;
    SingArea \Off;
    VelSet 100, 1000;
    cell_serves := TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_leave()
    cell_serves := FALSE;
    IF cell_old_tool <> "" SetSysData cell_any_tool \ObjectName:=cell_old_tool;
    IF cell_old_wobj <> "" SetSysData cell_any_wobj \ObjectName:=cell_old_wobj;
    IF cell_old_load <> "" SetSysData cell_any_load \ObjectName:=cell_old_load;
    VelSet cell_old_set.vel.oride, cell_old_set.vel.max;
    IF NOT cell_old_set.conf.jsup ConfJ \Off;
    IF NOT cell_old_set.conf.lsup ConfL \Off;
    IF cell_old_set.sing.wrist SingArea \Wrist;
    IF cell_old_set.sing.lockaxis4 SingArea \LockAxis4;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_settle()
    ! No interrupt until the arm stands and the abort is answered: it would restart the wait again and again.
    IDelete cell_abort_intno;
    IDelete cell_watch_intno;
    cell_beat := (cell_beat MOD 1000) + 1;
    cell_misses := 0;
    cell_drives := FALSE;
    cell_settled := FALSE;
    WaitTime \InPos, 0.3;
    WHILE IsStopMoveAct(\FromMoveTask) DO
      cell_permit;
    ENDWHILE
    cell_moving := FALSE;
    cell_settled := TRUE;
    IF cell_abort THEN
      cell_request := FALSE;
      cell_done_status := cell_abort_status;
      cell_done := TRUE;
      cell_abort := FALSE;
    ENDIF
    CONNECT cell_watch_intno WITH cell_watch_trap;
    ITimer CELL_WATCH_S, cell_watch_intno;
    CONNECT cell_abort_intno WITH cell_abort_trap;
    IPers cell_bell, cell_abort_intno;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_permit()
    ! StartMove fails while the arm still brakes: tried again.
    StartMove;
  ERROR
    SkipWarn;
    WaitTime 0.1;
    TRYNEXT;
  ENDPROC

  PROC cell_moves(bool stays)
    ! One move after the other, until a trap leaves it with CELL_ERR_ABORT or the client has gone.
    WHILE stays OR cell_wanted OR cell_request DO
      WaitUntil cell_request OR cell_abort OR (NOT (stays OR cell_wanted)) \PollRate:=0.04;
      IF cell_abort RETURN;
      IF cell_request THEN
        cell_request := FALSE;
        cell_one_move;
      ENDIF
    ENDWHILE
    IDelete cell_abort_intno;
    IDelete cell_watch_intno;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_one_move()
    VAR speeddata speed;
    VAR num limit := 0;
    VAR num found := 0;
    cell_from_joints := CJointT();
    found := cell_find_goal();
    IF found <> CB_OK THEN
      cell_verdict := found;
      RETURN;
    ENDIF
    limit := cell_goal_speed;
    IF OpMode() <> OP_AUTO AND limit > 250 limit := 250;
    ! A joint move travels and turns unevenly.
    IF cell_goal_kind <> 2 limit := 0.8 * limit;
    speed := cell_speed(limit);
    cell_settled := FALSE;
    cell_moving := TRUE;
    cell_drives := TRUE;
    cell_verdict := CB_ACCEPTED;
    TEST cell_goal_kind
    CASE 2:
      MoveL cell_goal, speed, fine, cell_flange \WObj:=wobj0;
    CASE 3:
      MoveAbsJ cell_goal_joints, speed, fine, cell_flange \WObj:=wobj0;
    DEFAULT:
      MoveJ cell_goal, speed, fine, cell_flange \WObj:=wobj0;
    ENDTEST
    cell_drives := FALSE;
    cell_moving := FALSE;
    WaitTime \InPos, 0.3;
    cell_settled := TRUE;
    cell_done_status := CB_OK;
    cell_done := TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  FUNC num cell_find_goal()
    ! Complete cell_goal and cell_goal_joints. A posture that does not fit, as on a border of confdata, is replaced by the
    ! neighbouring one with the least joint travel. No axis turns by more than cell_travel_max.
    VAR errnum reach := 0;
    IF cell_goal_kind = 3 THEN
      cell_goal := CalcRobT(cell_goal_joints, cell_flange \WObj:=wobj0);
      IF NOT cell_in_box(cell_goal.trans) RETURN CB_OUTSIDE_BOX;
    ELSE
      cell_goal_joints := CalcJointT(cell_goal, cell_flange \WObj:=wobj0 \ErrorNumber:=reach);
      IF reach <> 0 AND (NOT cell_found_near()) RETURN CB_UNREACHABLE;
    ENDIF
    IF cell_travel(cell_from_joints.robax, cell_goal_joints.robax) > cell_travel_max RETURN CB_UNREACHABLE;
    RETURN CB_OK;
  ERROR
    SkipWarn;
    ! An axis beyond its range.
    RETURN CB_UNREACHABLE;
  ENDFUNC

  FUNC bool cell_found_near()
    ! The neighbouring posture (axes 1, 4 and 6 a quarter turn on, elbow and wrist as asked) with the least travel.
    VAR robtarget trial;
    VAR jointtarget joints;
    VAR errnum reach := 0;
    VAR num least := 9999;
    VAR num turn := 0;
    trial := cell_goal;
    FOR i FROM -1 TO 1 DO
      FOR j FROM -1 TO 1 DO
        FOR k FROM -1 TO 1 DO
          trial.robconf.cf1 := cell_goal.robconf.cf1 + i;
          trial.robconf.cf4 := cell_goal.robconf.cf4 + j;
          trial.robconf.cf6 := cell_goal.robconf.cf6 + k;
          joints := CalcJointT(trial, cell_flange \WObj:=wobj0 \ErrorNumber:=reach);
          IF reach = 0 THEN
            turn := cell_travel(cell_from_joints.robax, joints.robax);
            IF turn < least THEN
              least := turn;
              cell_goal_joints := joints;
              cell_near := trial.robconf;
            ENDIF
          ENDIF
        ENDFOR
      ENDFOR
    ENDFOR
    IF least = 9999 RETURN FALSE;
    cell_goal.robconf := cell_near;
    RETURN TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_travel(robjoint one, robjoint other)
    ! The largest turn of an axis, in degrees.
    VAR num turn := 0;
    turn := cell_larger(Abs(one.rax_1 - other.rax_1), Abs(one.rax_2 - other.rax_2));
    turn := cell_larger(turn, cell_larger(Abs(one.rax_3 - other.rax_3), Abs(one.rax_4 - other.rax_4)));
    RETURN cell_larger(turn, cell_larger(Abs(one.rax_5 - other.rax_5), Abs(one.rax_6 - other.rax_6)));
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_larger(num one, num other)
    IF one > other RETURN one;
    RETURN other;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC bool cell_in_box(pos point)
    IF point.x < cell_box_low.x OR point.x > cell_box_high.x RETURN FALSE;
    IF point.y < cell_box_low.y OR point.y > cell_box_high.y RETURN FALSE;
    RETURN point.z >= cell_box_low.z AND point.z <= cell_box_high.z;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

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
    ! Stop the movement and clear the path; cell_obey goes on behind the procedure that was left.
    IF cell_abort THEN
      StopMove;
      ClearPath;
      RAISE CELL_ERR_ABORT;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDTRAP

  TRAP cell_watch_trap
    ! Show life to the communication task. When that one stands still, nobody could stop the move: end it here.
    cell_beat := (cell_beat MOD 1000) + 1;
    cell_misses := cell_misses + 1;
    IF (NOT cell_moving) OR cell_life <> cell_life_seen cell_misses := 0;
    cell_life_seen := cell_life;
    ! A move that the communication task has given up, since it saw no beat for long, is nobody's any more.
    IF cell_drives AND (NOT cell_moving) cell_misses := CELL_WATCHES;
    IF cell_misses >= CELL_WATCHES THEN
      cell_armed := FALSE;
      IF NOT cell_abort cell_abort_status := CB_ABORTED;
      cell_abort := TRUE;
      ErrWrite \W, "handeyed", "the communication task gave it up or shows no life: the move is ended";
      StopMove;
      ClearPath;
      RAISE CELL_ERR_ABORT;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDTRAP
ENDMODULE
