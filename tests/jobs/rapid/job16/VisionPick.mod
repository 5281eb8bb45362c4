%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE VisionPick
  PERS tooldata tPick:=[TRUE,[[0,0,310],[1,0,0,0]],[28,[0,0,130],[1,0,0,0],0,0,0]];
  PERS wobjdata wCam:=[FALSE,TRUE,"",[[1500,-200,720],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wVision:=[FALSE,TRUE,"",[[1500,-200,720],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PERS wobjdata wBin:=[FALSE,TRUE,"",[[500,1500,600],[0.819152,0,0,0.573576]],[[0,0,0],[1,0,0,0]]];
  VAR socketdev sock1;
  VAR string stRec;
  VAR num nX;
  VAR num nY;
  VAR num nA;
  VAR bool bOk;
  CONST robtarget pShot:=[[-0.16,-0.13,619.82],[0.000375,-0.000158,1,-0.000403],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pGrip:=[[-0.18,-0.01,24.96],[-0.000059,-0.001068,0.999999,-0.000022],[-1,-1,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pBin:=[[100.13,0.09,259.62],[-0.000458,-0.000227,1,0.000362],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  CONST robtarget pBinUp:=[[100.46,-0.2,649.75],[0.000819,-0.000301,0.999999,-0.000635],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC main()
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1500,fine,tPick;
    SocketCreate sock1;
    SocketConnect sock1,"192.168.125.20",3000\Time:=10;
    FOR n FROM 1 TO 10 DO
      MoveJ pShot,v2000,fine,tPick\WObj:=wCam;
      SocketSend sock1\Str:="TRG";
      SocketReceive sock1\Str:=stRec\Time:=5;
      bOk:=StrToVal(StrPart(stRec,1,7),nX);
      bOk:=StrToVal(StrPart(stRec,9,7),nY);
      bOk:=StrToVal(StrPart(stRec,17,7),nA);
      wVision.oframe:=[[nX,nY,0],OrientZYX(nA,0,0)];
      MoveJ Offs(pGrip,0,0,200),v1500,z20,tPick\WObj:=wVision;
      MoveL pGrip,v300,fine,tPick\WObj:=wVision;
      Set doVac;
      WaitTime 0.3;
      MoveL RelTool(pGrip,0,0,-200),v800,z20,tPick\WObj:=wVision;
      MoveJ pBinUp,v2000,z50,tPick\WObj:=wBin;
      MoveL pBin,v500,fine,tPick\WObj:=wBin;
      Reset doVac;
      MoveL pBinUp,v2000,z50,tPick\WObj:=wBin;
    ENDFOR
    SocketClose sock1;
    MoveAbsJ [[0,-20,20,0,60,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v1500,fine,tPick;
  ERROR
    IF ERRNO=ERR_SOCK_TIMEOUT THEN
      SocketClose sock1;
      EXIT;
    ENDIF
  ENDPROC
ENDMODULE
