MODULE Seams
  ! The seams of bracket 2107: points on the fixture, in wFixture.
  LOCAL CONST robtarget pA1:=[[60.00,40.00,12.50],[-0.018863955,0.972580906,0.085089804,0.215615996],[-1,-1,1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pA2:=[[60.00,160.00,12.50],[-0.02450166,0.970020235,0.110519846,0.215048309],[-1,-1,1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pA3:=[[60.00,280.00,12.50],[-0.030122572,0.966794761,0.135874143,0.214333238],[-1,-1,1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pA4:=[[60.00,400.00,12.50],[-0.03572284,0.962906695,0.161135319,0.213471275],[0,-1,1,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pRing1:=[[240.00,560.00,15.00],[0,0.987688341,-0,0.156434465],[0,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pRing2:=[[310.00,490.00,15.00],[0,0.987688341,-0,0.156434465],[0,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget pRing3:=[[380.00,560.00,15.00],[0,0.987688341,-0,0.156434465],[0,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
  LOCAL CONST robtarget stitches{8}:=[
    [[520.00,60.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,105.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,170.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,215.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,280.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,325.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,390.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[-1,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],
    [[520.00,435.00,12.50],[0.042009296,0.955554754,-0.168490085,0.238246558],[0,0,2,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]]];

  PROC edge()
    MoveJ Offs(pA1,0,0,40),v500,z10,tTorch\WObj:=wFixture;
    ArcLStart pA1,v100,seam1,weld1,fine,tTorch\WObj:=wFixture;
    ArcL pA2,v100,seam1,weld1,z1,tTorch\WObj:=wFixture;
    ArcL pA3,v100,seam1,weld1,z1,tTorch\WObj:=wFixture;
    ArcLEnd pA4,v100,seam1,weld1,fine,tTorch\WObj:=wFixture;
    MoveL RelTool(pA4,0,0,-40),v200,z10,tTorch\WObj:=wFixture;
  ENDPROC

  PROC stitch()
    FOR i FROM 1 TO 7 STEP 2 DO
      MoveL Offs(stitches{i},0,0,25),v200,z5,tTorch\WObj:=wFixture;
      ArcLStart stitches{i},v100,seam1,weld1,fine,tTorch\WObj:=wFixture;
      ArcLEnd stitches{i+1},v100,seam1,weld1,fine,tTorch\WObj:=wFixture;
      MoveL Offs(stitches{i+1},0,0,25),v200,z5,tTorch\WObj:=wFixture;
    ENDFOR
  ENDPROC

  PROC ring()
    MoveJ Offs(pRing1,0,0,30),v500,z5,tTorch\WObj:=wFixture;
    ArcLStart pRing1,v100,seam1,weld2,fine,tTorch\WObj:=wFixture;
    ArcCEnd pRing2,pRing3,v100,seam1,weld2,fine,tTorch\WObj:=wFixture;
    MoveL Offs(pRing3,0,0,30),v200,z5,tTorch\WObj:=wFixture;
  ENDPROC
ENDMODULE
