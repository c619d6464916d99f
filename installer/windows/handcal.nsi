; The Windows setup: unpacks the wheels and uv, which makes an environment of them with Python 3.13.
; Needs no administrator. Silent: handcal-setup.exe /S [/UNPACK] [/OPEN3D] [/D=C:\folder]; with
; /UNPACK the environment is left to `setup-environment.cmd`, for an administrator who prepares many
; PCs. The component Open3D takes its wheels from the folder handcal-open3d beside the setup; if there
; is none, uv fetches them.
; Defined by installer/build.sh: VERSION, PAYLOAD (folder), OUTPUT (file).
Unicode true
Target amd64-unicode
!include FileFunc.nsh
!include LogicLib.nsh
!include Sections.nsh
!define UNINSTALL "Software\Microsoft\Windows\CurrentVersion\Uninstall\handcal"

Name "handcal ${VERSION}"
OutFile "${OUTPUT}"
InstallDir "$LOCALAPPDATA\Programs\handcal"
InstallDirRegKey HKCU "${UNINSTALL}" "InstallLocation"
RequestExecutionLevel user
SetCompressor zlib ; wheels are compressed already
Icon "${PAYLOAD}\handcal.ico"
LicenseData "${PAYLOAD}\licences\LICENSE"
VIProductVersion "${VERSION}.0"
VIAddVersionKey ProductName "handcal"
VIAddVersionKey ProductVersion "${VERSION}"
VIAddVersionKey FileVersion "${VERSION}"
VIAddVersionKey FileDescription "handcal setup"
VIAddVersionKey LegalCopyright "the handcal authors, Apache-2.0"
Page license
Page components
Page directory
Page instfiles
UninstPage uninstConfirm
UninstPage instfiles

Section "handcal"
  SectionIn RO
  SetShellVarContext current
  SetOutPath "$INSTDIR"
  RMDir /r "$INSTDIR\env" ; of an older version
  RMDir /r "$INSTDIR\wheels"
  Delete "$INSTDIR\requirements-open3d.txt" ; it chooses Open3D below
  File /r /x requirements-open3d.txt "${PAYLOAD}\*"
  WriteUninstaller "$INSTDIR\uninstall.exe" ; first, so that a set-up that fails can be removed
  WriteRegStr HKCU "${UNINSTALL}" "DisplayName" "handcal"
  WriteRegStr HKCU "${UNINSTALL}" "DisplayVersion" "${VERSION}"
  WriteRegStr HKCU "${UNINSTALL}" "DisplayIcon" "$INSTDIR\handcal.ico"
  WriteRegStr HKCU "${UNINSTALL}" "InstallLocation" "$INSTDIR"
  WriteRegStr HKCU "${UNINSTALL}" "UninstallString" '"$INSTDIR\uninstall.exe"'
  WriteRegStr HKCU "${UNINSTALL}" "QuietUninstallString" '"$INSTDIR\uninstall.exe" /S'
  WriteRegDWORD HKCU "${UNINSTALL}" "NoModify" 1
  WriteRegDWORD HKCU "${UNINSTALL}" "NoRepair" 1
  CreateDirectory "$SMPROGRAMS\handcal"
  CreateShortcut "$SMPROGRAMS\handcal\handcal.lnk" "$INSTDIR\env\Scripts\handcal-gui.exe" "" "$INSTDIR\handcal.ico"
  CreateShortcut "$SMPROGRAMS\handcal\handcal commands.lnk" "$SYSDIR\cmd.exe" \
    '/K "set PATH=$INSTDIR\env\Scripts;%PATH%"' "$INSTDIR\handcal.ico"
SectionEnd

Section /o "Open3D, for Inspect in 3D" OPEN3D
  SetOutPath "$INSTDIR"
  File "${PAYLOAD}\requirements-open3d.txt"
  ${If} ${FileExists} "$EXEDIR\handcal-open3d\*.whl"
    CopyFiles /SILENT "$EXEDIR\handcal-open3d\*.whl" "$INSTDIR\wheels"
    CopyFiles /SILENT "$EXEDIR\handcal-open3d\licences\*" "$INSTDIR\licences"
  ${EndIf}
SectionEnd

Section
  ${GetParameters} $0
  ${GetOptions} $0 "/UNPACK" $1
  ${IfNot} ${Errors}
    Return
  ${EndIf}
  DetailPrint "Setting up Python 3.13 and the packages; this takes some minutes"
  nsExec::ExecToLog '"$SYSDIR\cmd.exe" /C ""$INSTDIR\setup-environment.cmd""'
  Pop $0
  ${If} $0 == 3
    SetErrorLevel 3
    MessageBox MB_ICONEXCLAMATION "handcal is set up, but Open3D could not be fetched. Connect this \
PC, or put the folder handcal-open3d beside the setup, and run the setup again." /SD IDOK
  ${ElseIf} $0 != 0
    SetErrorLevel 2
    MessageBox MB_ICONSTOP "Python could not be set up. If this PC has no Python 3.13, it must be \
online. Run the setup again, or $INSTDIR\setup-environment.cmd to see the reason." /SD IDOK
    Abort "Python could not be set up"
  ${EndIf}
SectionEnd

Function .onInit
  ${GetParameters} $0
  ${GetOptions} $0 "/OPEN3D" $1
  ${IfNot} ${Errors}
    SectionSetFlags ${OPEN3D} ${SF_SELECTED}
  ${EndIf}
FunctionEnd

Section Uninstall
  SetShellVarContext current
  ; Only what the setup made: the folder may hold a user's files. Sessions and preferences stay.
  RMDir /r "$INSTDIR\env"
  RMDir /r "$INSTDIR\python"
  RMDir /r "$INSTDIR\wheels"
  RMDir /r "$INSTDIR\licences"
  DeleteRegValue HKCU "Software\Khronos\OpenXR\1\ApiLayers\Implicit" "$LOCALAPPDATA\handcal\openxr\handcal.json"
  RMDir /r "$LOCALAPPDATA\handcal\openxr" ; what handcal openxr install has made
  Delete "$INSTDIR\uv.exe"
  Delete "$INSTDIR\requirements.txt"
  Delete "$INSTDIR\requirements-open3d.txt"
  Delete "$INSTDIR\setup-environment.cmd"
  Delete "$INSTDIR\handcal.ico"
  Delete "$INSTDIR\uninstall.exe"
  RMDir "$INSTDIR"
  RMDir /r "$SMPROGRAMS\handcal"
  DeleteRegKey HKCU "${UNINSTALL}"
SectionEnd
