%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Frame12
  !  weld frame 12, old process data
  PERS tooldata tMIG:=[TRUE,[[66,1,340],[0.951057,0,-0.309017,0]],[6.8,[15,0,110],[1,0,0,0],0,0,0]];
  PERS wobjdata wFrame:=[FALSE,TRUE,"",[[1000,-350,640],[0.999848,0,0,-0.017452]],[[0,0,0],[1,0,0,0]]];
  PERS seamdata seam1:=[0.5,0.5,0,0];
  PERS welddata weld1:=[6,10,0,0];
  PERS welddata weld2:=[7,12,0,0];
  PERS weavedata weave0:=[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0];
  VAR num nWelds:=0;

  PROC main()
    MoveAbsJ [[0,-20,25,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tMIG;
    WaitDI diFixtureClosed,1;
    seamsA;
    seamsB;
    MoveAbsJ [[0,-20,25,0,60,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tMIG;
    SetDO doFixtureOpen,1;
  ENDPROC

  PROC seamsA()
    MoveJ [[19.77,19.64,119.88],[0.422898,0.000343,0.906177,-0.000017],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v800,z10,tMIG\WObj:=wFrame;
    ArcL\On,[[29.85,20.32,0.71],[0.421937,0.000031,0.906625,0.000482],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld1,weave0,fine,tMIG\WObj:=wFrame;
    ArcL [[130.05,19.77,1.05],[0.422936,0.000031,0.906159,0.000464],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld1,weave0,z5,tMIG\WObj:=wFrame;
    ArcC [[151.21,28.41,0.82],[0.422365,0.000866,0.906425,-0.00063],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[159.86,49.93,1.17],[0.42303,-0.000141,0.906116,-0.00013],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld2,weave0,z5,tMIG\WObj:=wFrame;
    ArcL\Off,[[159.63,179.92,1.39],[0.423182,0.000632,0.906044,-0.000124],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld1,weave0,fine,tMIG\WObj:=wFrame;
    MoveL [[149.6,180.19,130.19],[0.422781,0.000103,0.906232,0.000251],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,z10,tMIG\WObj:=wFrame;
    nWelds:=nWelds+1;
  ENDPROC

  PROC seamsB()
    MoveJ [[299.79,39.78,120.15],[0.405498,0.11136,0.90656,-0.036325],[-1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v800,z10,tMIG\WObj:=wFrame;
    ArcL\On,[[299.81,50.37,0.77],[0.404625,0.111356,0.906954,-0.036241],[-1,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld2,weave0,fine,tMIG\WObj:=wFrame;
    ArcL\Off,[[304.23,210.11,1.17],[0.405766,0.112259,0.906265,-0.037893],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,seam1,weld2,weave0,fine,tMIG\WObj:=wFrame;
    MoveL RelTool([[303.96,209.75,0.72],[0.405092,0.112476,0.906534,-0.038013],[-1,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],0,0,-120),v500,z10,tMIG\WObj:=wFrame;
  ENDPROC
ENDMODULE
