%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Prog_L
  LOCAL CONST robtarget pApp:=[[-0.06,-0.27,199.77],[0.422163039,0.000628316,0.906519374,-0.00077301],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL PERS robtarget p10:=[[29.61,19.85,1.93],[0.42223839,-0.000061363,0.906484825,0.000004964],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL PERS robtarget p20:=[[140.18,19.63,2.66],[0.422821518,0.000056974,0.906212838,0.000503321],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL PERS robtarget p30:=[[219.63,26.27,2.13],[0.423250004,0.000505301,0.90601243,-0.00081023],[-1,0,-1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL PERS robtarget p40:=[[59.63,159.85,1.97],[0.403001768,0.118894059,0.905930274,-0.052384317],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL PERS robtarget p50:=[[210,166.33,1.97],[0.402773761,0.119251494,0.905958013,-0.052843707],[-1,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];

  PROC Weld_L()
    MoveJ pApp,v1000,z20,tFronius\WObj:=wLeft;
    ArcLStart p10,v200,seamA,weldA,fine,tFronius\WObj:=wLeft\SeamName:="L1";
    ArcL p20,v100,seamA,weldA,z1,tFronius\WObj:=wLeft;
    ArcLEnd p30,v100,seamA,weldA,fine,tFronius\WObj:=wLeft;
    MoveL RelTool(p30,0,0,-90),v500,z10,tFronius\WObj:=wLeft;
    MoveJ RelTool(p40,0,0,-90),v800,z10,tFronius\WObj:=wLeft;
    ArcLStart p40,v200,seamA,weldB,fine,tFronius\WObj:=wLeft\SeamName:="L2";
    ArcLEnd p50,v100,seamA,weldB,fine,tFronius\WObj:=wLeft;
    MoveL RelTool(p50,0,0,-90),v500,z10,tFronius\WObj:=wLeft;
    MoveJ pApp,v1000,z20,tFronius\WObj:=wLeft;
  ENDPROC
ENDMODULE
