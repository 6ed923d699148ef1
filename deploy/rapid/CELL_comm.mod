MODULE CELL_comm
  ! The communication task (T_HANDEYED): the CB link, one client, over TCP or a serial line.
  CONST num CELL_HEARTBEAT := 2;
  CONST num CELL_HALF_FRAME := 0.5;
  CONST num CELL_IDLE := 10;
  CONST num CELL_PAYLOAD_MAX := 1012;
  CONST num CELL_BUILD := 5;
  CONST num CELL_STANDS := 0.01;
  ! A sign of life of the motion task is this young (s); without one for this long another program runs there.
  CONST num CELL_BEAT_MAX := 2;
  CONST num CELL_FOREIGN := 5;
  CONST num CELL_MINUTE := 60;
  CONST num CELL_LONG := 4000000;
  ! A load (kg) below this is that of tool0, 1 gram: not measured.
  CONST num CELL_LOAD_MIN := 0.01;

  VAR socketdev cell_server;
  ! Two sockets: the client is cell_peer{cell_who}, a waiting one is cell_peer{cell_other}.
  VAR socketdev cell_peer{2};
  VAR num cell_who := 1;
  VAR num cell_other := 2;
  VAR iodev cell_line;
  VAR clock cell_heard;
  VAR clock cell_quiet;
  VAR clock cell_since_hello;
  VAR clock cell_guest_since;
  VAR clock cell_looked;
  VAR clock cell_rung;
  VAR clock cell_sampled;
  VAR clock cell_probed;
  VAR clock cell_beaten;
  VAR clock cell_told;
  VAR clock cell_released;

  VAR signaldo cell_do_light;
  VAR signaldo cell_do_trigger;
  VAR signaldi cell_di_1;
  VAR signaldi cell_di_2;
  VAR signaldi cell_di_3;
  VAR signaldi cell_di_4;
  VAR bool cell_named := FALSE;
  ! The error that ended the last move, as the event log has it.
  VAR intnum cell_error_intno;
  VAR errdomain cell_error_domain;
  VAR num cell_error_number := 0;
  VAR string cell_error_title := "";
  VAR string cell_error_cause := "";

  VAR bool cell_open := FALSE;
  VAR bool cell_has_guest := FALSE;
  VAR bool cell_greeted := FALSE;
  VAR bool cell_watched := FALSE;
  VAR bool cell_busy := FALSE;
  VAR bool cell_timed_out := FALSE;
  VAR bool cell_stored := FALSE;
  VAR bool cell_keep := FALSE;
  VAR bool cell_silent := FALSE;
  VAR num cell_byte := 0;
  VAR num cell_beat_seen := 0;
  VAR bool cell_alive := FALSE;
  VAR num cell_fault := 0;

  ! The frame that is being received, and the answer that is being built.
  VAR rawbytes cell_rx;
  VAR rawbytes cell_rest;
  VAR rawbytes cell_part;
  VAR rawbytes cell_tx;
  VAR num cell_have := 0;
  VAR num cell_got := 0;
  VAR num cell_command := 0;
  VAR num cell_seq := 0;
  VAR num cell_len := 0;
  VAR num cell_sum := 0;
  VAR num cell_status := 0;
  VAR num cell_pos := 0;

  ! The newest request and its reply: a repeated request is answered from here.
  VAR rawbytes cell_last_request;
  VAR rawbytes cell_last_reply;
  VAR num cell_last_seq := 0;

  VAR num cell_move_seq := 0;
  VAR num cell_finished_seq := 0;
  VAR num cell_finished_status := 0;
  VAR robtarget cell_asked;
  VAR robtarget cell_here;
  VAR jointtarget cell_seen;
  VAR jointtarget cell_asked_joints;

  FUNC num cell_fletcher(VAR rawbytes data, num count)
    ! Fletcher-16 of bytes 1 to 10 and the payload. For 1022 bytes low is at most 260610: high stays below 2^23, exact in a num.
    VAR num low := 0;
    VAR num high := 0;
    VAR num value := 0;
    FOR i FROM 1 TO 10 DO
      UnpackRawBytes data, i, value \IntX:=USINT;
      low := low + value;
      high := high + low;
    ENDFOR
    IF count > 12 THEN
      FOR i FROM 13 TO count DO
        UnpackRawBytes data, i, value \IntX:=USINT;
        low := low + value;
        high := high + low;
        IF high > 8000000 high := high MOD 255;
      ENDFOR
    ENDIF
    RETURN (high MOD 255) * 256 + low MOD 255;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_length_of(num command)
    TEST command
    CASE 1:
      RETURN 0;
    CASE 2:
      RETURN 8;
    CASE 3:
      RETURN 2;
    CASE 4:
      RETURN 68;
    CASE 5:
      RETURN 0;
    CASE 6:
      RETURN 0;
    CASE 7:
      RETURN 4;
    CASE 8:
      RETURN 0;
    CASE 9:
      RETURN 0;
    CASE 10:
      RETURN 52;
    CASE 11:
      RETURN 0;
    CASE 12:
      RETURN 4;
    CASE 13:
      RETURN 0;
    DEFAULT:
      RETURN -1;
    ENDTEST
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_u16(num offset)
    ! A field of the payload; offset counts from its first byte.
    VAR num value := 0;
    UnpackRawBytes cell_rx, 13 + offset, value \IntX:=UINT;
    RETURN value;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_float(num offset)
    VAR num value := 0;
    UnpackRawBytes cell_rx, 13 + offset, value \Float4;
    RETURN value;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC bool cell_finite(num offset)
    ! NaN and infinity have an exponent of ones.
    VAR num top := 0;
    VAR num next := 0;
    UnpackRawBytes cell_rx, 13 + offset + 3, top \IntX:=USINT;
    UnpackRawBytes cell_rx, 13 + offset + 2, next \IntX:=USINT;
    RETURN ((top MOD 128) <> 127) OR (next < 128);
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_forbidden()
    ! The first reason against any motion; CB_OK when there is none.
    IF DOutput(cell_do_estop) = 1 RETURN CB_ESTOP;
    IF DOutput(cell_do_motors) = 0 RETURN CB_MOTORS_OFF;
    IF OpMode() = OP_MAN_TEST RETURN CB_WRONG_MODE;
    IF DOutput(cell_do_running) = 1 RETURN CB_OK;
    IF DOutput(cell_do_error) = 1 RETURN CB_MOTION_ERROR;
    RETURN CB_WRONG_MODE;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_unsafe()
    ! Why the arm must not be armed or moved besides cell_forbidden; CB_OK when nothing is against it.
    IF cell_flange.tload.mass < CELL_LOAD_MIN RETURN CB_NO_LOAD;
    IF NOT cell_inputs() RETURN CB_INTERLOCK;
    RETURN CB_OK;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC bool cell_inputs()
    ! Whether every input of cell_interlock is 1. A name that the controller does not know counts as 0.
    IF cell_interlock{1} = "" AND cell_interlock{2} = "" AND cell_interlock{3} = "" AND cell_interlock{4} = "" RETURN TRUE;
    IF NOT cell_named RETURN FALSE;
    IF NOT cell_input(cell_interlock{1}, cell_di_1) RETURN FALSE;
    IF NOT cell_input(cell_interlock{2}, cell_di_2) RETURN FALSE;
    IF NOT cell_input(cell_interlock{3}, cell_di_3) RETURN FALSE;
    RETURN cell_input(cell_interlock{4}, cell_di_4);
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC bool cell_input(string name, VAR signaldi signal)
    IF name = "" RETURN TRUE;
    RETURN DInput(signal) = 1;
  ERROR
    SkipWarn;
    RETURN FALSE;
  ENDFUNC

  PROC cell_name_signals()
    ! Connect the signals that the settings name.
    cell_named := FALSE;
    IF cell_light <> "" AliasIO cell_light, cell_do_light;
    IF cell_trigger <> "" AliasIO cell_trigger, cell_do_trigger;
    IF cell_interlock{1} <> "" AliasIO cell_interlock{1}, cell_di_1;
    IF cell_interlock{2} <> "" AliasIO cell_interlock{2}, cell_di_2;
    IF cell_interlock{3} <> "" AliasIO cell_interlock{3}, cell_di_3;
    IF cell_interlock{4} <> "" AliasIO cell_interlock{4}, cell_di_4;
    cell_named := TRUE;
  ERROR
    SkipWarn;
    cell_write "a signal that CELL_shared names is not there: nothing is armed";
    RETURN;
  ENDPROC

  FUNC num cell_flags()
    VAR num flags := 0;
    IF DOutput(cell_do_motors) = 1 flags := flags + 1;
    IF OpMode() = OP_AUTO flags := flags + 2;
    IF DOutput(cell_do_estop) = 1 flags := flags + 4;
    IF cell_moving flags := flags + 8;
    IF cell_settled AND (NOT cell_moving) flags := flags + 16;
    IF cell_armed flags := flags + 32;
    IF DOutput(cell_do_running) = 1 flags := flags + 64;
    IF (OpMode() <> OP_AUTO) OR (CSpeedOverride() < 100) flags := flags + 128;
    RETURN flags;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_age(VAR clock watch)
    ! Seconds since cell_zero. A clock overflows after 49 days and 17 hours: CELL_LONG then, and it begins anew.
    RETURN ClkRead(watch);
  ERROR
    SkipWarn;
    IF ERRNO = ERR_OVERFLOW THEN
      cell_zero watch;
      RETURN CELL_LONG;
    ENDIF
    RAISE;
  ENDFUNC

  PROC cell_zero(VAR clock watch)
    ClkReset watch;
    ClkStart watch;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_note_beat()
    ! Every change of cell_beat is a sign of life of the motion task.
    IF cell_beat = cell_beat_seen RETURN;
    cell_beat_seen := cell_beat;
    cell_alive := TRUE;
    cell_zero cell_beaten;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  FUNC bool cell_ready()
    ! Whether the motion task serves now: inside cell_motion, alive since it and this task run, every abort answered.
    cell_note_beat;
    RETURN cell_serves AND cell_alive AND (NOT cell_abort) AND cell_age(cell_beaten) < CELL_BEAT_MAX;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC string cell_own_address()
    ! A virtual controller has no address of its own: GetSysInfo answers VC there.
    IF cell_address <> "" RETURN cell_address;
    IF RobOS() RETURN GetSysInfo(\LanIp);
    RETURN "127.0.0.1";
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_t_ms()
    IF cell_age(cell_since_hello) >= 8000 THEN
      cell_zero cell_since_hello;
    ENDIF
    RETURN Trunc(cell_age(cell_since_hello) * 1000);
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_axis_progress(num start, num goal, num now, num best)
    ! Progress per mille of the axis with the longest way; best carries the way so far.
    IF Abs(goal - start) <= best RETURN -1;
    RETURN Trunc(1000 * Abs(now - start) / Abs(goal - start));
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_progress()
    VAR jointtarget now;
    VAR num start{6};
    VAR num goal{6};
    VAR num at{6};
    VAR num longest := 0.0001;
    VAR num part := 1000;
    VAR num done := 0;
    IF NOT cell_busy RETURN 1000;
    now := CJointT(\TaskName:=cell_motion_task);
    start := [cell_from_joints.robax.rax_1, cell_from_joints.robax.rax_2, cell_from_joints.robax.rax_3, cell_from_joints.robax.rax_4, cell_from_joints.robax.rax_5, cell_from_joints.robax.rax_6];
    goal := [cell_goal_joints.robax.rax_1, cell_goal_joints.robax.rax_2, cell_goal_joints.robax.rax_3, cell_goal_joints.robax.rax_4, cell_goal_joints.robax.rax_5, cell_goal_joints.robax.rax_6];
    at := [now.robax.rax_1, now.robax.rax_2, now.robax.rax_3, now.robax.rax_4, now.robax.rax_5, now.robax.rax_6];
    FOR i FROM 1 TO 6 DO
      done := cell_axis_progress(start{i}, goal{i}, at{i}, longest);
      IF done >= 0 THEN
        longest := Abs(goal{i} - start{i});
        part := done;
      ENDIF
    ENDFOR
    IF part > 1000 part := 1000;
    RETURN part;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC num cell_apart(jointtarget one, jointtarget other)
    ! Distance of two postures: sum of the axes' differences, in degrees.
    VAR num sum := 0;
    sum := Abs(one.robax.rax_1 - other.robax.rax_1) + Abs(one.robax.rax_2 - other.robax.rax_2);
    sum := sum + Abs(one.robax.rax_3 - other.robax.rax_3) + Abs(one.robax.rax_4 - other.robax.rax_4);
    RETURN sum + Abs(one.robax.rax_5 - other.robax.rax_5) + Abs(one.robax.rax_6 - other.robax.rax_6);
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  FUNC bool cell_repeated()
    ! Whether the request equals the one before, byte for byte.
    VAR num count := 0;
    VAR num new := 0;
    VAR num old := 0;
    count := 12 + cell_len;
    IF RawBytesLen(cell_last_request) <> count RETURN FALSE;
    FOR i FROM 1 TO count DO
      UnpackRawBytes cell_rx, i, new \IntX:=USINT;
      UnpackRawBytes cell_last_request, i, old \IntX:=USINT;
      IF new <> old RETURN FALSE;
    ENDFOR
    RETURN TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDFUNC

  PROC main()
    cell_reset;
    WHILE TRUE DO
      cell_run;
      cell_begin_anew;
    ENDWHILE
  ERROR
    ! Whatever has failed, the link begins anew: this task never ends.
    SkipWarn;
    cell_fault := ERRNO;
    TRYNEXT;
  UNDO
    cell_armed := FALSE;
    SocketClose cell_peer{1};
    SocketClose cell_peer{2};
    SocketClose cell_server;
  ENDPROC

  PROC cell_run()
    ! Serve clients until something fails.
    IF cell_use_serial THEN
      Open cell_device, cell_line \Bin;
      ClearIOBuff cell_line;
      WHILE TRUE DO
        cell_serve;
      ENDWHILE
    ENDIF
    cell_listen;
    WHILE TRUE DO
      cell_accept;
      IF cell_open cell_serve;
      SocketClose cell_peer{cell_who};
      cell_supervise;
    ENDWHILE
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_begin_anew()
    ! The link has failed: address in use, network not there, plug pulled. Close everything, wait a second.
    cell_halt CB_ABORTED;
    cell_wanted := FALSE;
    cell_greeted := FALSE;
    cell_watched := FALSE;
    cell_has_guest := FALSE;
    SocketClose cell_peer{1};
    SocketClose cell_peer{2};
    SocketClose cell_server;
    IF cell_use_serial Close cell_line;
    cell_tell "the link begins anew, error " + NumToStr(cell_fault, 0);
    FOR i FROM 1 TO 10 DO
      cell_supervise;
      WaitTime 0.1;
    ENDFOR
  ERROR
    SkipWarn;
    TRYNEXT;
  ENDPROC

  PROC cell_reset()
    ! A PERS outlives a restart: reset everything. A move that power or restart interrupted is held until it is dropped.
    IF cell_moving OR cell_request OR cell_held cell_hold;
    cell_wanted := FALSE;
    cell_session := (cell_session MOD 65535) + 1;
    cell_armed := FALSE;
    cell_busy := FALSE;
    cell_request := FALSE;
    cell_done := FALSE;
    cell_verdict := 0;
    cell_abort_status := CB_ABORTED;
    cell_abort := TRUE;
    cell_ring;
    cell_last_seq := 0;
    cell_stored := FALSE;
    cell_greeted := FALSE;
    cell_watched := FALSE;
    cell_finished_seq := 0;
    cell_finished_status := CB_OK;
    cell_zero cell_looked;
    cell_zero cell_sampled;
    cell_zero cell_probed;
    cell_zero cell_beaten;
    cell_beat_seen := cell_beat;
    cell_alive := FALSE;
    cell_zero cell_released;
    cell_zero cell_rung;
    cell_silent := FALSE;
    cell_name_signals;
    IDelete cell_error_intno;
    CONNECT cell_error_intno WITH cell_error_trap;
    IError COMMON_ERR, TYPE_ERR, cell_error_intno;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  TRAP cell_error_trap
    ! Keep the error of a move: the first one of the domain of motion, otherwise the newest.
    VAR trapdata event;
    VAR errdomain domain;
    VAR num number := 0;
    VAR errtype type;
    VAR string title := "";
    VAR string cause := "";
    GetTrapData event;
    ReadErrData event, domain, number, type \Title:=title \Str1:=cause;
    IF cell_error_domain = MOTION_ERR AND cell_error_number <> 0 RETURN;
    cell_error_domain := domain;
    cell_error_number := domain * 10000 + number;
    cell_error_title := title;
    cell_error_cause := cause;
  ERROR
    SkipWarn;
    TRYNEXT;
  ENDTRAP

  PROC cell_listen()
    SocketClose cell_server;
    SocketClose cell_peer{1};
    SocketClose cell_peer{2};
    cell_has_guest := FALSE;
    SocketCreate cell_server;
    SocketBind cell_server, cell_own_address(), cell_port;
    SocketListen cell_server;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_accept()
    ! The waiting connection becomes the client, otherwise the next one.
    cell_open := TRUE;
    IF cell_has_guest THEN
      cell_other := cell_who;
      cell_who := 3 - cell_who;
      cell_has_guest := FALSE;
      RETURN;
    ENDIF
    SocketAccept cell_server, cell_peer{cell_who} \Time:=0.1;
  ERROR
    SkipWarn;
    cell_open := FALSE;
    IF ERRNO = ERR_SOCK_TIMEOUT THEN
      TRYNEXT;
    ENDIF
    RAISE;
  ENDPROC

  PROC cell_serve()
    cell_open := TRUE;
    cell_have := 0;
    cell_greeted := FALSE;
    cell_stored := FALSE;
    ClearRawBytes cell_rx;
    cell_zero cell_heard;
    cell_zero cell_quiet;
    WHILE cell_open DO
      cell_step;
      cell_tick;
    ENDWHILE
    cell_halt CB_ABORTED;
    cell_wanted := FALSE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_step()
    ! Receive bytes until a frame is complete.
    VAR num missing := 12;
    IF cell_have >= 12 missing := 12 + cell_len;
    missing := missing - cell_have;
    IF missing <= 0 THEN
      cell_frame;
      RETURN;
    ENDIF
    IF cell_use_serial THEN
      cell_take_line missing;
    ELSE
      cell_take_socket missing;
    ENDIF
    IF cell_got > 0 THEN
      cell_zero cell_quiet;
      cell_check_head;
    ELSEIF cell_have > 0 AND cell_age(cell_quiet) >= CELL_HALF_FRAME THEN
      cell_drop;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_take_socket(num missing)
    ! Never request more than has arrived, except one byte now and then, which notices a closed connection.
    VAR num count := 0;
    cell_got := 0;
    count := SocketPeek(cell_peer{cell_who});
    IF count > missing count := missing;
    IF count < 1 THEN
      IF cell_age(cell_probed) < 0.5 THEN
        WaitTime 0.01;
        RETURN;
      ENDIF
      count := 1;
    ENDIF
    cell_zero cell_probed;
    cell_timed_out := FALSE;
    SocketReceive cell_peer{cell_who} \RawData:=cell_part \ReadNoOfBytes:=count \NoRecBytes:=cell_got \Time:=0.02;
    IF cell_timed_out cell_got := 0;
    IF cell_got > 0 THEN
      CopyRawBytes cell_part, 1, cell_rx, cell_have + 1 \NoOfBytes:=cell_got;
      cell_have := cell_have + cell_got;
    ENDIF
  ERROR
    SkipWarn;
    IF ERRNO = ERR_SOCK_TIMEOUT THEN
      cell_timed_out := TRUE;
      TRYNEXT;
    ENDIF
    cell_got := 0;
    cell_open := FALSE;
    RETURN;
  ENDPROC

  PROC cell_take_line(num missing)
    ! A few bytes at a time, so that nothing else is delayed for long.
    VAR num most := 16;
    IF missing < most most := missing;
    cell_got := 0;
    cell_timed_out := FALSE;
    WHILE cell_got < most AND (NOT cell_timed_out) DO
      cell_byte := ReadBin(cell_line \Time:=0.02);
      IF NOT cell_timed_out THEN
        cell_have := cell_have + 1;
        cell_got := cell_got + 1;
        PackRawBytes cell_byte, cell_rx, cell_have \IntX:=USINT;
      ENDIF
    ENDWHILE
  ERROR
    SkipWarn;
    IF ERRNO = ERR_DEV_MAXTIME THEN
      cell_timed_out := TRUE;
      TRYNEXT;
    ENDIF
    RAISE;
  ENDPROC

  PROC cell_check_head()
    ! Skip bytes that cannot begin a frame.
    VAR bool looking := TRUE;
    VAR num value := 0;
    WHILE looking AND cell_open DO
      looking := FALSE;
      IF cell_have >= 1 THEN
        UnpackRawBytes cell_rx, 1, value \IntX:=USINT;
        looking := value <> 67;
      ENDIF
      IF cell_have >= 2 AND (NOT looking) THEN
        UnpackRawBytes cell_rx, 2, value \IntX:=USINT;
        looking := value <> 66;
      ENDIF
      IF cell_have >= 10 AND (NOT looking) THEN
        UnpackRawBytes cell_rx, 9, cell_len \IntX:=UINT;
        looking := cell_len > CELL_PAYLOAD_MAX;
      ENDIF
      IF looking cell_shift;
    ENDWHILE
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_drop()
    ! Incomplete frame or wrong sum: TCP closes, a serial line searches behind its first byte.
    cell_shift;
    IF cell_open cell_check_head;
    cell_zero cell_quiet;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_shift()
    IF NOT cell_use_serial THEN
      cell_open := FALSE;
      RETURN;
    ENDIF
    cell_cut 1;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_cut(num count)
    ! Drop the first bytes of what was received.
    ClearRawBytes cell_rest;
    IF cell_have > count CopyRawBytes cell_rx, count + 1, cell_rest, 1 \NoOfBytes:=cell_have - count;
    ClearRawBytes cell_rx;
    IF cell_have > count CopyRawBytes cell_rest, 1, cell_rx, 1 \NoOfBytes:=cell_have - count;
    cell_have := cell_have - count;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_frame()
    VAR num sum := 0;
    UnpackRawBytes cell_rx, 4, cell_command \IntX:=USINT;
    UnpackRawBytes cell_rx, 5, cell_seq \IntX:=UINT;
    UnpackRawBytes cell_rx, 11, cell_sum \IntX:=UINT;
    sum := cell_fletcher(cell_rx, 12 + cell_len);
    cell_begin;
    IF sum <> cell_sum THEN
      cell_status := CB_BAD_SUM;
      cell_send;
      cell_drop;
      RETURN;
    ENDIF
    cell_zero cell_heard;
    cell_watched := TRUE;
    cell_judge;
    IF cell_open THEN
      cell_cut 12 + cell_len;
      cell_check_head;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_judge()
    ! Version, repeats and lengths; then the command.
    VAR num version := 0;
    VAR num ahead := 0;
    UnpackRawBytes cell_rx, 3, version \IntX:=USINT;
    IF cell_seq = 0 THEN
      cell_refuse CB_BAD_FIELD;
      RETURN;
    ENDIF
    IF version <> 1 THEN
      cell_refuse CB_BAD_VERSION;
      RETURN;
    ENDIF
    IF cell_stored THEN
      ahead := cell_seq - cell_last_seq;
      IF ahead < 0 ahead := ahead + 65535;
      IF ahead = 0 THEN
        IF cell_repeated() THEN
          cell_put cell_last_reply;
          RETURN;
        ENDIF
      ENDIF
      IF (ahead = 0 OR ahead > 32767) AND cell_command <> 2 THEN
        cell_refuse CB_SEQ_TAKEN;
        RETURN;
      ENDIF
    ENDIF
    IF cell_length_of(cell_command) < 0 THEN
      cell_refuse CB_UNKNOWN_CMD;
      RETURN;
    ENDIF
    IF cell_len <> cell_length_of(cell_command) THEN
      cell_refuse CB_BAD_LEN;
      RETURN;
    ENDIF
    IF (NOT cell_greeted) AND cell_command > 2 THEN
      cell_refuse CB_BAD_VERSION;
      RETURN;
    ENDIF
    cell_keep := TRUE;
    cell_do_command;
    IF (cell_command = 4 OR cell_command = 10) AND cell_status <> CB_ACCEPTED cell_tell "a move is refused, status " + NumToStr(cell_status, 0);
    IF cell_keep THEN
      cell_finish_frame;
      cell_remember;
      cell_put cell_tx;
    ENDIF
    IF cell_command = 9 AND cell_keep THEN
      cell_wanted := FALSE;
      cell_greeted := FALSE;
      cell_watched := FALSE;
      IF NOT cell_use_serial cell_open := FALSE;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_remember()
    ClearRawBytes cell_last_request;
    CopyRawBytes cell_rx, 1, cell_last_request, 1 \NoOfBytes:=12 + cell_len;
    ClearRawBytes cell_last_reply;
    CopyRawBytes cell_tx, 1, cell_last_reply, 1;
    cell_last_seq := cell_seq;
    cell_stored := TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_do_command()
    TEST cell_command
    CASE 1:
      cell_status := CB_OK;
    CASE 2:
      cell_hello;
    CASE 3:
      cell_get_pose;
    CASE 4:
      cell_move;
    CASE 5:
      cell_stop CB_ABORTED;
    CASE 6:
      cell_report;
    CASE 7:
      cell_arm;
    CASE 8:
      cell_get_joints;
    CASE 9:
      cell_halt CB_ABORTED;
    CASE 10:
      cell_move;
    CASE 11:
      cell_get_error;
    CASE 12:
      cell_set_output;
    CASE 13:
      cell_get_setup;
    ENDTEST
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_hello()
    VAR num version_max := 0;
    version_max := cell_u16(2);
    IF version_max = 0 version_max := cell_u16(0);
    IF cell_u16(0) > 1 OR version_max < 1 THEN
      cell_refuse CB_BAD_VERSION;
      RETURN;
    ENDIF
    cell_halt CB_ABORTED;
    cell_wanted := TRUE;
    cell_await_motion;
    cell_finished_seq := 0;
    cell_finished_status := CB_OK;
    cell_greeted := TRUE;
    cell_zero cell_since_hello;
    cell_add_u16 1;
    cell_add_u16 255;
    cell_add_u16 cell_session;
    cell_add_u16 CELL_BUILD;
    cell_add_u16 1024;
    cell_add_u16 6;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_await_motion()
    ! A stopped move belongs to the previous client: its end is not reported to this one, and it does not continue.
    cell_busy := FALSE;
    WaitUntil DOutput(cell_do_running) = 0 OR (NOT cell_abort) \MaxTime:=1.5 \PollRate:=0.04;
    IF DOutput(cell_do_running) = 1 cell_await_beat 0.3;
  ERROR
    SkipWarn;
    IF ERRNO = ERR_WAIT_MAXTIME THEN
      IF cell_moving OR cell_request cell_hold;
      TRYNEXT;
    ENDIF
    RAISE;
  ENDPROC

  PROC cell_await_beat(num limit)
    ! A main that calls cell_motion does so soon, if it does not work now.
    WaitUntil cell_ready() \MaxTime:=limit \PollRate:=0.04;
  ERROR
    SkipWarn;
    TRYNEXT;
  ENDPROC

  PROC cell_get_pose()
    IF cell_u16(0) > 1 THEN
      cell_refuse CB_BAD_FIELD;
      RETURN;
    ENDIF
    IF cell_u16(0) = 1 THEN
      cell_here := CRobT(\TaskName:=cell_motion_task \Tool:=cell_tool \WObj:=cell_wobj);
    ELSE
      cell_here := CRobT(\TaskName:=cell_motion_task \Tool:=tool0 \WObj:=wobj0);
    ENDIF
    cell_add_float cell_here.trans.x;
    cell_add_float cell_here.trans.y;
    cell_add_float cell_here.trans.z;
    cell_add_float cell_here.rot.q1;
    cell_add_float cell_here.rot.q2;
    cell_add_float cell_here.rot.q3;
    cell_add_float cell_here.rot.q4;
    cell_add_i16 cell_here.robconf.cf1;
    cell_add_i16 cell_here.robconf.cf4;
    cell_add_i16 cell_here.robconf.cf6;
    cell_add_i16 cell_here.robconf.cfx;
    cell_add_extax cell_here.extax;
    cell_add_u32 cell_t_ms();
    cell_add_u16 cell_flags();
    cell_add_u16 0;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_get_joints()
    VAR jointtarget now;
    now := CJointT(\TaskName:=cell_motion_task);
    cell_add_float now.robax.rax_1;
    cell_add_float now.robax.rax_2;
    cell_add_float now.robax.rax_3;
    cell_add_float now.robax.rax_4;
    cell_add_float now.robax.rax_5;
    cell_add_float now.robax.rax_6;
    cell_add_extax now.extax;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_report()
    cell_note_end;
    cell_add_u16 cell_flags();
    cell_add_u16 cell_finished_seq;
    cell_add_u16 cell_finished_status;
    cell_add_u16 cell_progress();
    cell_add_u32 cell_t_ms();
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_get_error()
    cell_add_u32 cell_error_number;
    cell_add_text cell_error_title;
    cell_add_text cell_error_cause;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_set_output()
    ! 1: the light, 2: the trigger. A signal that the settings do not name, or the controller has not, is refused.
    IF cell_u16(2) < 2 AND cell_named THEN
      IF cell_u16(0) = 1 AND cell_light <> "" THEN
        SetDO cell_do_light, cell_u16(2);
        RETURN;
      ENDIF
      IF cell_u16(0) = 2 AND cell_trigger <> "" THEN
        SetDO cell_do_trigger, cell_u16(2);
        RETURN;
      ENDIF
    ENDIF
    cell_refuse CB_BAD_FIELD;
  ERROR
    SkipWarn;
    cell_refuse CB_BAD_FIELD;
    RETURN;
  ENDPROC

  PROC cell_get_setup()
    cell_add_float cell_flange.tload.mass;
    cell_add_pos cell_flange.tload.cog;
    cell_add_float cell_reach;
    cell_add_float cell_speed_max;
    cell_add_float cell_travel_max;
    cell_add_pos cell_box_low;
    cell_add_pos cell_box_high;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_arm()
    VAR num against := 0;
    IF cell_u16(2) > 1 THEN
      cell_refuse CB_BAD_FIELD;
      RETURN;
    ENDIF
    IF cell_u16(2) = 0 THEN
      cell_halt CB_ABORTED;
      RETURN;
    ENDIF
    against := cell_forbidden();
    IF against = CB_OK against := cell_unsafe();
    IF against = CB_OK cell_await_beat 0.5;
    IF against = CB_OK AND (NOT cell_ready()) against := CB_WRONG_MODE;
    IF against = CB_OK AND cell_u16(0) <> cell_session against := CB_NOT_ARMED;
    cell_status := against;
    IF against = CB_OK cell_armed := TRUE;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_move()
    VAR num kind := 3;
    VAR num speed_at := 48;
    IF cell_command = 4 THEN
      kind := cell_u16(64);
      speed_at := 60;
    ENDIF
    IF kind < 1 OR kind > 3 OR (cell_command = 4 AND kind = 3) THEN
      cell_refuse CB_BAD_FIELD;
      RETURN;
    ENDIF
    cell_note_end;
    cell_status := cell_forbidden();
    IF cell_status <> CB_OK RETURN;
    cell_status := cell_unsafe();
    IF cell_status <> CB_OK RETURN;
    cell_status := CB_NOT_ARMED;
    IF NOT cell_armed RETURN;
    cell_status := CB_BUSY;
    IF cell_busy OR cell_abort OR cell_held RETURN;
    cell_status := CB_WRONG_MODE;
    IF NOT cell_ready() RETURN;
    cell_check_speed speed_at;
    IF cell_status <> CB_OK RETURN;
    IF kind = 3 THEN
      cell_read_joints;
    ELSE
      cell_read_goal;
    ENDIF
    IF cell_status <> CB_OK RETURN;
    IF kind = 3 THEN
      cell_goal_joints := cell_asked_joints;
    ELSE
      cell_goal := cell_asked;
    ENDIF
    cell_goal_speed := cell_float(speed_at);
    cell_goal_kind := kind;
    cell_error_domain := 0;
    cell_error_number := 0;
    cell_error_title := "";
    cell_error_cause := "";
    cell_verdict := 0;
    cell_done := FALSE;
    cell_request := TRUE;
    cell_await_verdict;
    IF cell_status = CB_ACCEPTED THEN
      cell_move_seq := cell_seq;
      cell_busy := TRUE;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_await_verdict()
    WaitUntil cell_verdict <> 0 \MaxTime:=1 \PollRate:=0.04;
    cell_status := cell_verdict;
  ERROR
    ! The motion task is late. A move refused here must not begin later.
    SkipWarn;
    IF ERRNO = ERR_WAIT_MAXTIME THEN
      cell_armed := FALSE;
      cell_abort_status := CB_WRONG_MODE;
      cell_abort := TRUE;
      cell_hold;
      cell_ring;
      cell_status := CB_WRONG_MODE;
      RETURN;
    ENDIF
    RAISE;
  ENDPROC

  PROC cell_check_speed(num speed_at)
    cell_status := CB_SPEED;
    IF NOT cell_finite(speed_at) RETURN;
    IF cell_float(speed_at) <= 0 OR cell_float(speed_at) > cell_speed_max RETURN;
    cell_status := CB_OK;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_read_joints()
    ! Axes of a goal; the motion task checks the rest.
    VAR jointtarget now;
    cell_status := CB_BAD_FIELD;
    FOR i FROM 0 TO 11 DO
      IF NOT cell_finite(4 * i) RETURN;
    ENDFOR
    FOR i FROM 0 TO 5 DO
      IF Abs(cell_float(4 * i)) > 2000 RETURN;
    ENDFOR
    now := CJointT(\TaskName:=cell_motion_task);
    cell_asked_joints.robax := [cell_float(0), cell_float(4), cell_float(8), cell_float(12), cell_float(16), cell_float(20)];
    cell_asked_joints.extax := now.extax;
    cell_read_extax 24, cell_asked_joints.extax;
    cell_status := CB_OK;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_read_extax(num offset, VAR extjoint axes)
    ! Goals of the external axes that exist.
    IF axes.eax_a < 8.9E9 axes.eax_a := cell_float(offset);
    IF axes.eax_b < 8.9E9 axes.eax_b := cell_float(offset + 4);
    IF axes.eax_c < 8.9E9 axes.eax_c := cell_float(offset + 8);
    IF axes.eax_d < 8.9E9 axes.eax_d := cell_float(offset + 12);
    IF axes.eax_e < 8.9E9 axes.eax_e := cell_float(offset + 16);
    IF axes.eax_f < 8.9E9 axes.eax_f := cell_float(offset + 20);
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_read_goal()
    ! Checks of a goal, except its reach.
    VAR num norm := 0;
    cell_status := CB_BAD_FIELD;
    FOR i FROM 0 TO 6 DO
      IF NOT cell_finite(4 * i) RETURN;
    ENDFOR
    FOR i FROM 0 TO 5 DO
      IF NOT cell_finite(36 + 4 * i) RETURN;
    ENDFOR
    FOR i FROM 3 TO 6 DO
      IF Abs(cell_float(4 * i)) > 1.01 RETURN;
    ENDFOR
    cell_asked.trans := [cell_float(0), cell_float(4), cell_float(8)];
    cell_asked.rot := [cell_float(12), cell_float(16), cell_float(20), cell_float(24)];
    norm := Sqrt(cell_float(12) * cell_float(12) + cell_float(16) * cell_float(16) + cell_float(20) * cell_float(20) + cell_float(24) * cell_float(24));
    IF Abs(norm - 1) > 0.002 RETURN;
    cell_asked.rot := NOrient(cell_asked.rot);
    UnpackRawBytes cell_rx, 41, cell_asked.robconf.cf1 \IntX:=INT;
    UnpackRawBytes cell_rx, 43, cell_asked.robconf.cf4 \IntX:=INT;
    UnpackRawBytes cell_rx, 45, cell_asked.robconf.cf6 \IntX:=INT;
    UnpackRawBytes cell_rx, 47, cell_asked.robconf.cfx \IntX:=INT;
    cell_here := CRobT(\TaskName:=cell_motion_task \Tool:=tool0 \WObj:=wobj0);
    cell_asked.extax := cell_here.extax;
    cell_read_extax 36, cell_asked.extax;
    cell_status := CB_OUTSIDE_BOX;
    IF cell_asked.trans.x < cell_box_low.x OR cell_asked.trans.x > cell_box_high.x RETURN;
    IF cell_asked.trans.y < cell_box_low.y OR cell_asked.trans.y > cell_box_high.y RETURN;
    IF cell_asked.trans.z < cell_box_low.z OR cell_asked.trans.z > cell_box_high.z RETURN;
    cell_status := CB_OK;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_stop(num reason)
    ! Request a stop of the motion task, which its trap carries out.
    IF cell_busy AND (NOT cell_done) AND (NOT cell_abort) THEN
      cell_abort_status := reason;
      cell_abort := TRUE;
      cell_ring;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_ring()
    ! Trigger the trap of the motion task. An interrupt during a stop of that task is lost.
    cell_bell := 1 - cell_bell;
    cell_zero cell_rung;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_halt(num reason)
    cell_armed := FALSE;
    cell_stop reason;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_note_end()
    IF cell_busy AND cell_done AND (NOT cell_abort) THEN
      cell_finished_seq := cell_move_seq;
      cell_finished_status := cell_done_status;
      cell_busy := FALSE;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_supervise()
    ! Supervise the motion task: permission to move, running, abort answered. The motion task supervises this one.
    cell_life := (cell_life MOD 1000000) + 1;
    cell_note_beat;
    IF (cell_armed OR cell_busy) AND cell_forbidden() <> CB_OK THEN
      cell_halt cell_forbidden();
      IF cell_busy cell_hold;
    ENDIF
    IF (cell_armed OR cell_busy) AND (NOT cell_inputs()) cell_halt CB_INTERLOCK;
    IF DOutput(cell_do_running) = 0 THEN
      cell_alive := FALSE;
      cell_zero cell_beaten;
      cell_take_over;
      RETURN;
    ENDIF
    IF cell_age(cell_beaten) >= CELL_FOREIGN THEN
      cell_give_up;
      RETURN;
    ENDIF
    IF cell_abort AND cell_age(cell_rung) >= 0.1 cell_ring;
    IF cell_held AND (NOT cell_abort) AND cell_forbidden() = CB_OK cell_release;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_give_up()
    ! Another program runs in the motion task: nothing of an old move is left, and that program must not be held.
    cell_armed := FALSE;
    IF cell_busy cell_note_stop;
    cell_request := FALSE;
    cell_moving := FALSE;
    cell_abort := FALSE;
    IF cell_held cell_release;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_hold()
    ! Hold motion until a move is dropped: an interrupted one would continue at the next start, a late one would begin.
    IF cell_held AND IsStopMoveAct(\FromNonMoveTask) RETURN;
    cell_held := TRUE;
    StopMove \AllMotionTasks;
  ERROR
    SkipWarn;
    TRYNEXT;
  ENDPROC

  PROC cell_release()
    ! StartMove fails while the arm still brakes: tried again.
    IF cell_age(cell_released) < 0.1 RETURN;
    cell_zero cell_released;
    IF IsStopMoveAct(\FromNonMoveTask) StartMove \AllMotionTasks;
    cell_held := FALSE;
  ERROR
    SkipWarn;
    RETURN;
  ENDPROC

  PROC cell_take_over()
    ! The motion task is stopped and cannot report how its move ended: report it once the arm stands still.
    VAR jointtarget now;
    IF (NOT cell_busy) AND (NOT cell_moving) RETURN;
    IF cell_age(cell_sampled) < 0.1 RETURN;
    cell_zero cell_sampled;
    now := CJointT(\TaskName:=cell_motion_task);
    IF cell_apart(now, cell_seen) < CELL_STANDS THEN
      cell_moving := FALSE;
      cell_settled := TRUE;
      IF cell_busy cell_note_stop;
    ENDIF
    cell_seen := now;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_note_stop()
    cell_finished_seq := cell_move_seq;
    cell_finished_status := CB_ABORTED;
    IF cell_abort cell_finished_status := cell_abort_status;
    IF cell_finished_status = CB_WRONG_MODE AND DOutput(cell_do_error) = 1 cell_finished_status := CB_MOTION_ERROR;
    cell_busy := FALSE;
    IF cell_greeted AND cell_open cell_announce;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_tick()
    ! Periodic work: switches, silence, the end of a move, a second client.
    cell_supervise;
    IF cell_watched AND cell_age(cell_heard) >= CELL_HEARTBEAT THEN
      cell_watched := FALSE;
      IF cell_armed OR cell_busy cell_write "no sign of life from the PC for 2 s: stopped and disarmed";
      cell_halt CB_ABORTED;
    ENDIF
    IF (NOT cell_use_serial) AND cell_age(cell_heard) >= CELL_IDLE cell_open := FALSE;
    IF cell_busy AND cell_done AND (NOT cell_abort) THEN
      cell_note_end;
      IF cell_greeted cell_announce;
    ENDIF
    IF cell_use_serial RETURN;
    IF cell_age(cell_looked) >= 0.1 THEN
      cell_zero cell_looked;
      cell_look_for_guest;
    ENDIF
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_tell(string what)
    ! Write to the event log of the controller, at most once a minute.
    IF cell_silent AND cell_age(cell_told) < CELL_MINUTE RETURN;
    cell_write what;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_write(string what)
    cell_silent := TRUE;
    cell_zero cell_told;
    ErrWrite \I, "handeyed", what;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_announce()
    cell_command := 6;
    cell_seq := 0;
    cell_begin;
    cell_report;
    cell_send;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_look_for_guest()
    ! One client: a second one is answered BUSY, unless the first has fallen silent.
    IF cell_has_guest THEN
      cell_answer_guest;
      RETURN;
    ENDIF
    cell_has_guest := TRUE;
    SocketAccept cell_server, cell_peer{cell_other} \Time:=0.001;
    cell_zero cell_guest_since;
  ERROR
    SkipWarn;
    IF ERRNO = ERR_SOCK_TIMEOUT THEN
      cell_has_guest := FALSE;
      RETURN;
    ENDIF
    RAISE;
  ENDPROC

  PROC cell_answer_guest()
    VAR num command := 0;
    VAR num seq := 0;
    VAR num got := 0;
    IF cell_age(cell_heard) >= CELL_HEARTBEAT THEN
      cell_open := FALSE;
      RETURN;
    ENDIF
    IF SocketPeek(cell_peer{cell_other}) >= 12 THEN
      SocketReceive cell_peer{cell_other} \RawData:=cell_part \ReadNoOfBytes:=12 \NoRecBytes:=got \Time:=0.1;
      UnpackRawBytes cell_part, 4, command \IntX:=USINT;
      UnpackRawBytes cell_part, 5, seq \IntX:=UINT;
      cell_command := command;
      cell_seq := seq;
      cell_begin;
      cell_status := CB_BUSY;
      cell_finish_frame;
      SocketSend cell_peer{cell_other} \RawData:=cell_tx \NoOfBytes:=RawBytesLen(cell_tx);
      cell_has_guest := FALSE;
      SocketClose cell_peer{cell_other};
    ELSEIF cell_age(cell_guest_since) >= 1 THEN
      cell_has_guest := FALSE;
      SocketClose cell_peer{cell_other};
    ENDIF
  ERROR
    SkipWarn;
    cell_has_guest := FALSE;
    SocketClose cell_peer{cell_other};
    RETURN;
  ENDPROC

  PROC cell_begin()
    ! An empty answer to cell_command and cell_seq.
    ClearRawBytes cell_tx;
    cell_status := CB_OK;
    cell_pos := 13;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_refuse(num status)
    ! A refusal by the link itself: it is not stored.
    cell_keep := FALSE;
    cell_status := status;
    cell_send;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_u16(num value)
    PackRawBytes value, cell_tx, cell_pos \IntX:=UINT;
    cell_pos := cell_pos + 2;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_i16(num value)
    PackRawBytes value, cell_tx, cell_pos \IntX:=INT;
    cell_pos := cell_pos + 2;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_u32(num value)
    PackRawBytes value, cell_tx, cell_pos \IntX:=UDINT;
    cell_pos := cell_pos + 4;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_float(num value)
    PackRawBytes value, cell_tx, cell_pos \Float4;
    cell_pos := cell_pos + 4;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_pos(pos point)
    cell_add_float point.x;
    cell_add_float point.y;
    cell_add_float point.z;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_text(string text)
    ! 80 bytes, zeros behind the text.
    FOR i FROM 0 TO 19 DO
      PackRawBytes 0, cell_tx, cell_pos + 4 * i \IntX:=UDINT;
    ENDFOR
    IF StrLen(text) > 0 PackRawBytes text, cell_tx, cell_pos \ASCII;
    cell_pos := cell_pos + 80;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_add_extax(extjoint axes)
    cell_add_float axes.eax_a;
    cell_add_float axes.eax_b;
    cell_add_float axes.eax_c;
    cell_add_float axes.eax_d;
    cell_add_float axes.eax_e;
    cell_add_float axes.eax_f;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_finish_frame()
    VAR num sum := 0;
    PackRawBytes 67, cell_tx, 1 \IntX:=USINT;
    PackRawBytes 66, cell_tx, 2 \IntX:=USINT;
    PackRawBytes 1, cell_tx, 3 \IntX:=USINT;
    PackRawBytes 128 + (cell_command MOD 128), cell_tx, 4 \IntX:=USINT;
    PackRawBytes cell_seq, cell_tx, 5 \IntX:=UINT;
    PackRawBytes cell_status, cell_tx, 7 \IntX:=UINT;
    PackRawBytes cell_pos - 13, cell_tx, 9 \IntX:=UINT;
    sum := cell_fletcher(cell_tx, cell_pos - 1);
    PackRawBytes sum, cell_tx, 11 \IntX:=UINT;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_send()
    cell_finish_frame;
    cell_put cell_tx;
  ERROR
    SkipWarn;
    RAISE;
  ENDPROC

  PROC cell_put(VAR rawbytes data)
    IF cell_use_serial THEN
      WriteRawBytes cell_line, data;
    ELSE
      SocketSend cell_peer{cell_who} \RawData:=data \NoOfBytes:=RawBytesLen(data);
    ENDIF
  ERROR
    SkipWarn;
    cell_open := FALSE;
    RETURN;
  ENDPROC
ENDMODULE
