%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Loader
  TASK PERS tooldata tLoader:=[TRUE,[[0,0,370],[1,0,0,0]],[57,[0,0,180],[1,0,0,0],0,0,0]];
  TASK PERS wobjdata wM1:=[FALSE,TRUE,"",[[1650,-250,900],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST jointtarget jBase:=[[0,-20,20,0,60,0],[0,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pM1a:=[[-350.01,19.53,349.42],[0.000209,-0.000435,1,-0.000327],[-1,-1,-1,0],[0,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pM1b:=[[30.47,20.35,330.02],[-0.0012,-0.00041,0.999999,0.001123],[-1,0,-1,0],[0,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pM1c:=[[30.51,19.86,69.44],[0.001217,0.000635,0.999999,-0.000961],[-1,-1,-1,0],[0,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pM2b:=[[29.89,1820.17,330.54],[-0.000274,0.000899,0.999999,0.000827],[-1,0,-1,0],[1800,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pM2c:=[[29.8,1819.62,72.14],[-0.000076,0.00024,1,0.000155],[-1,0,-1,0],[1800,9E9,9E9,9E9,9E9,9E9]];

  PROC main()
    MoveAbsJ jBase,v1000,fine,tLoader;
    Load1;
    Load2;
    MoveAbsJ jBase,v1000,fine,tLoader;
    Load1;
    MoveAbsJ jBase,v1000,fine,tLoader;
  ENDPROC

  PROC Load1()
    MoveJ pM1a,v1500,z50,tLoader\WObj:=wM1;
    MoveL pM1b,v800,z20,tLoader\WObj:=wM1;
    MoveL pM1c,v150,fine,tLoader\WObj:=wM1;
    Set doOpen;
    WaitTime 0.5;
    MoveL pM1b,v400,z20,tLoader\WObj:=wM1;
    MoveL pM1a,v1500,z50,tLoader\WObj:=wM1;
  ENDPROC

  PROC Load2()
    MoveJ pM2b,v1000,z20,tLoader\WObj:=wM1;
    MoveL pM2c,v150,fine,tLoader\WObj:=wM1;
    Set doOpen;
    WaitTime 0.5;
    MoveL pM2b,v400,z20,tLoader\WObj:=wM1;
  ENDPROC
ENDMODULE
