%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE TrackJob
    ! robot on IRBT, eax_a is the track. At rack A the track stays at 0.
    PERS tooldata tool_grip:=[TRUE,[[0,0,340],[1,0,0,0]],[52,[0,0,160],[1,0,0,0],0,0,0]];
    PERS wobjdata wobj_rack:=[FALSE,TRUE,"",[[1700,-300,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    CONST jointtarget jpos_home:=[[0,-25,25,0,60,0],[0,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST jointtarget jpos_far:=[[0,-25,25,0,60,0],[2200,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget p_rack1:=[[119.79,79.25,19.48],[0.000991,0.000202,0.999999,0.0002],[-1,0,-1,0],[0,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget p_rack2:=[[320.01,79.49,19.94],[0.001034,0.00071,0.999999,0.000419],[-1,0,-1,0],[0,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget p_b1:=[[1650.19,2299.38,1099.54],[0.000241,0.000244,1,0.000079],[0,0,0,0],[2200,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST robtarget p_b2:=[[1649.23,2300.54,735.52],[0.000642,-0.000123,1,-0.000105],[0,-1,0,0],[2200,9E+09,9E+09,9E+09,9E+09,9E+09]];

    PROC main()
        MoveAbsJ jpos_home,v1000,fine,tool_grip;
        MoveJ Offs(p_rack1,0,0,300),v1000,z50,tool_grip\WObj:=wobj_rack;
        MoveL p_rack1,v300,fine,tool_grip\WObj:=wobj_rack;
        SetDO do_grip,1;
        WaitTime 0.5;
        MoveL Offs(p_rack1,0,0,300),v800,z50,tool_grip\WObj:=wobj_rack;
        MoveAbsJ jpos_far,v1000,z50,tool_grip;
        MoveL p_b1,v800,z20,tool_grip;
        MoveL p_b2,v200,fine,tool_grip;
        SetDO do_grip,0;
        WaitTime 0.5;
        MoveL p_b1,v800,z50,tool_grip;
        MoveAbsJ jpos_far,v1000,z50,tool_grip;
        MoveAbsJ jpos_home,v1000,z50,tool_grip;
        MoveJ Offs(p_rack2,0,0,300),v1000,z50,tool_grip\WObj:=wobj_rack;
        MoveL p_rack2,v300,fine,tool_grip\WObj:=wobj_rack;
        MoveL Offs(p_rack2,0,0,300),v800,z50,tool_grip\WObj:=wobj_rack;
        MoveAbsJ jpos_home,v1000,fine,tool_grip;
    ENDPROC
ENDMODULE
