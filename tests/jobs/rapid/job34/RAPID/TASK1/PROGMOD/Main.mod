%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Main
    PERS tooldata toolGlue:=[TRUE,[[70,-5,320],[0.945519,0,-0.325568,0]],[27,[30,0,130],[1,0,0,0],0,0,0]];
    PERS wobjdata wHood:=[FALSE,TRUE,"",[[1500,-400,760],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    PROC main()
        MoveAbsJ [[0,-20,20,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,toolGlue;
        IF diPart=1 THEN
            GlueHood;
        ENDIF
        IF diNozzleDirty=1 THEN
            CleanNozzle;
        ENDIF
        MoveAbsJ [[0,-20,20,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,toolGlue;
    ERROR
        TPWrite "glue error";
        EXIT;
    ENDPROC
    PROC CleanNozzle()
        MoveJ [[700.17,-1350.31,1150.24],[0.32243,0.49642,0.779248,-0.205862],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,z50,toolGlue;
        MoveL [[699.72,-1400.37,955.42],[0.322857,0.495472,0.780126,-0.204143],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v200,fine,toolGlue;
        PulseDO\PLength:=1.5,doBrush;
        WaitTime 1.5;
        MoveL [[699.93,-1350.2,1150.1],[0.323923,0.495454,0.779464,-0.205025],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,z50,toolGlue;
    ENDPROC
ENDMODULE
