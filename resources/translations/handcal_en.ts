<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="en" sourcelanguage="en">
<context>
    <name></name>
    <message>
        <source>Starting handcal…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Starting…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The headset sends too few poses to place a hand; close other programs on it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}; press Restart headset in Link</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}; see Link</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>fewer than two thirds of the camera&apos;s frames are used; close other programs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>plug the camera into a USB 3 port</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>close other programs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>frames per second: often below the {:.0f} needed; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>record the trial</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>move the outline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>go back</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>choose the eyes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The trial is not recorded yet: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>restart the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>set φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>record φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>show the target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>hide the target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>compare</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>delete the {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>restore the {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>set the eye distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Could not {}: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>save the notes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} was not opened: cancelled</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reading the session…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancel</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This session was only verified; it has no alignments.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>It contains no alignments yet.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solved again by this version; when it was recorded, the verdict was {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose how the RealSense takes images. Calibrate without filters: they smooth and invent depth.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the camera&apos;s setting</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Default</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>High accuracy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>High density</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Medium density</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Camera settings</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Image size</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth preset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The RealSense SDK&apos;s visual preset; the settings below take precedence.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Of the depth image; a frame lasts 33,333 µs.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Laser power</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Power of the projector; 0 mW switches it off.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Exposure of colour for the whole image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Spatial</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Temporal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Measures the exposure of colour on the whole image, not on the hand once found.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Largest (1280 × 720 or 848 × 480 px, 30 Hz)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Size and rate of both depth and colour images.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Exposure of depth</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Automatic</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Keep the camera&apos;s setting</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For the &amp;whole image, even once a hand is found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Smooths each depth image, keeping edges.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Averages over the last depth images.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fills in depth where none was measured.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Hole filling</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Image size</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth &amp;preset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Exposure of depth</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Exposure of colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Laser power</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth filters</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Restore defaults</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Restore &amp;defaults</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} filter</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>sent, not acknowledged yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>acknowledged by the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not acknowledged; try again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer &amp;sees it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer sees &amp;it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Connect a headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Code to type in the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Invite another headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;New code</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Close</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A headset is connected. New code pairs another one.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Scan the code with the headset&apos;s app. Without a camera: choose this computer ({}, port {}) in the app and type the digits.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>no headset is connected yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Paired. From now on the headset connects automatically.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The code has expired. New code makes another one.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Test square, 8 cm at 0.5 m</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show to &amp;{}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: the wearer sees it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tick it when the wearer sees the square with this eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Export {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Export</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Cancel</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verdict, eye shifts, figures and settings, to read and archive</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The report for a browser, and each figure with its data</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One row for each eye, alignment and trial, for statistics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Projection, K, H0 and φ of each eye, read by cv2.FileStorage</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The projections in the convention of each system</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cursor and hand of each alignment, with residuals</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All recorded data, to archive or to open elsewhere</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The final calibration for Unity&apos;s JsonUtility</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The final calibration as views of OpenXR: poses and angles</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The final calibration for Monado&apos;s North Star driver</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The eyes as transforms and the clouds as models</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Anything nearer is not drawn.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Anything farther is not drawn.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Export folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Checking the folder…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The export will create the folder {} there.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Files of the same names in the folder {} there will be replaced.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose what to write: nothing is ticked.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose the folder to export to.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose another folder to export to.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose what to write and where, then export.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For one program each:</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Far plane</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ne&amp;ar plane (OpenGL, Unity)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Export &amp;to</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>nothing was exported; the sessions and earlier exports are unchanged</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>see the reasons below, then go back to choose another folder or try again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the session and earlier exports are unchanged</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Progress</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Files</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Starting</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Done.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} in {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>files</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Open folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} not exported, see below.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing was exported.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}; go back to choose another folder, or to try again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancelling…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>cancelled</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Paired headsets</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Device</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>None yet. Headsets appear here once they are paired.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rename the chosen headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rena&amp;me</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Re&amp;voke…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Revoke the chosen headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>It can then no longer connect</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Without a name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, connected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Revoke {}? Its session ends, and it connects again only after it has been paired again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Revoke</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Same as the system</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Light</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Dark</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>High contrast</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Largest expected error of an eye that is accepted, in arcminutes.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Where eyes are</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Where eyes are, even if far</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eyes, and what is seen wrongly</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All of it, even if far</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Learn from the finished sessions in this folder with the same rig, once there are enough:
where wearers&apos; eyes are; and from wearers with several sessions, how far beside, and how
much larger, people see the hand than it is (otherwise 1′ and 0.25 % are assumed). A mean of
the eyes more than 4 mm from the rig&apos;s viewpoint is used only with &apos;even if far&apos;: a fault of
the rig or of the depth camera&apos;s edges is more likely.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Off</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For this computer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For other computers, too</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Serve OpenIGTLink during calibrations, for 3D Slicer and others. It has no password:
any computer that reaches the address can read.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>TCP port of OpenIGTLink.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send the events of calibrations to the Lab Streaming Layer, on which any computer of the
local network can read them.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Preferences</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Theme</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Session folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Learned</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Learned</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>What earlier sessions tell of the next wearer.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send &amp;events</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tar&amp;get</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Largest expected error of an accepted eye; 60′ is 1°.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The&amp;me</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Session f&amp;older</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Shows the default of every field; Cancel keeps the former values.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Change what you need and press OK. A running calibration keeps its settings.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sent to other programs by the next calibrations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Port</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Colours of all windows.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Prior</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>port</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses and results, for 3D Slicer; no password.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>TCP port of OpenIGTLink on this computer.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Marks events in recordings of other instruments.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Program</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose a folder, write one file there, and send it with a bug report to the handcal developers. It contains the checks of the installation, package versions, and the log, in which wearers&apos; names, your user name and the home folder are replaced; nothing from sessions, and camera frames only if you add a recording here.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>nothing was written; choose another folder or recording, and try again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Support bundle</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recording to add</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>None</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The file {} will be written to the folder.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Write</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Recording to add</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} was written; it contains {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose the folder to write to.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Window</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>works everywhere</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>works during a calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>a menu; works everywhere</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>a panel; works while it has the keyboard focus</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press the button, or open the list, that has the focus</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Return</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Return on the start page</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start the calibration, from one of its fields</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press its button, or go to its field</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alt+underlined letter</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>F4</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open the list, or choose the file or folder, of the field</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Shift+F4</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose a folder for a field that takes files, too</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Esc</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Close the message, or a dialog or window opened from here</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move to the next button or field</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tab</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alt+Left, Alt+Right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In the manual: go back or forward</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>F6, Shift+F6</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In the list of Sessions: sort by the next column, or in reverse</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ctrl+Tab</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the next tab of the panel that has the focus</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Guide</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fine-tune</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Arrows, PgUp, PgDown</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move what the chosen eye sees in the key&apos;s direction</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Look at the result, then export it, or resume the session to add to it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Resume the session to make its first alignment.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Export…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Resume</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open camera and headset to add alignments, fine-tuning or trials</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Use in XR</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use for every OpenXR program on this computer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Calibrate &amp;again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For the same wearer again, or after the headset has slipped: starts from this result and first verifies each eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Clo&amp;se</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Session without a name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Started</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not finished</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>finished</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>verified eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>verified eyes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>alignments</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>trial</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>trials</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} fine-tuned</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>with another φ after going back</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Contents</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Note</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Repair, in All sessions (Ctrl+L), copies what is sound.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Damaged</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Journal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The last line is incomplete, as after a crash.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Chosen by the seed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Advanced</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Real time</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Plays at the recorded rate; otherwise every frame, as fast as possible.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Loop</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Starts again at the end.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recordings</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Seed of the simulated wearer, hand and room.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Datagrams dropped in each direction.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Datagrams delivered out of order.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulated hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand that is raised.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulated wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulated loss</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulated reordering</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulator</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recording</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RealSense recordings ({})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Any serial number</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Settin&amp;gs…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Serial number</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Image size, preset, exposure, laser power and filters.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Address of the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Virtual headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Network headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Address to listen on</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Address of this computer on which to listen for the headset; 0.0.0.0 for all.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>UDP port that the headset connects to.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>at</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cop&amp;y</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pairing key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start a calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Enter a name, now or later in All sessions, and start; the settings are kept.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Wearer&apos;s name or code</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name or code</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancel the start (Esc)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Checking camera, headset and files…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Opening camera and headset…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fix first: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancelling once camera and headset are open…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recommended</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>As in the paper</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recommended: the hand is raised once; the cursors are placed where they are most
informative, and each eye is verified. The steps run automatically.
As in the paper: the cursor is the hand where it is held; you choose the eyes in the guide.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Both eyes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Left eye only</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Right eye only</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Plan</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eyes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Only one, if the wearer sees with one eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source> · verification begun</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source> · damaged: {} left out</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>part</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>parts</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>make it readable, restore it from a backup, or delete it in All sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Resume</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Continue a calibration that was interrupted.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Unfinished sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Res&amp;ume</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open a session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Review it, compare methods, export it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recent sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Open</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recent sessions will be listed here.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open the example session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>E&amp;xample</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A simulated wearer&apos;s session, copied to the session folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose fo&amp;lder…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All sess&amp;ions…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search, compare, export and repair sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Evaluate</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulated studies, the cube test, and the user test.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Measure the accuracy of calibrations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Evalua&amp;te…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Calibrate a see-through headset with the wearer&apos;s bare hand.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hea&amp;dset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Rig file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Session folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rig file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rig files (*.yaml *.yml)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Example rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The offline calibration of headset and camera; the virtual headset accepts any.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Co&amp;nnect…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Plan</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use the usual gate</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use the si&amp;mulator</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use a networ&amp;k headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use the exa&amp;mple</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Calibrate a rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cali&amp;brate…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Each calibration gets its own folder in this folder.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use the virtual headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press the large button, except from a text field</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press the large button from anywhere</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Confirm for the wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, or {} from a text field</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, or Return while this button has the focus</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer has looked slowly to the left and to the right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand held still</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No hand in view</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} eye: {}, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Guide camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Guide {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The camera&apos;s image will appear here.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, before the calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, now</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} The hand stays up.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Back</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Raise one bare hand {}, palm toward you and fingers a little apart; hold it still.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Waiting…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hold the hand still: it becomes the cursor for {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the hand up: the next cursor, for {}, follows at once.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the hand up, and make the next cursor, for {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Make cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keeping offline…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} The wearer may lower the hand.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Discard and repeat</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Deletes the last alignment; the session panel can restore it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For {}: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not every eye has been verified. Finish as it is, or verify an eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not every eye has been verified since the alignments changed. Finish, or verify an eye again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verified, and tested in trials, before the alignments changed. Finish, or verify an eye again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not accepted yet: verify {} again. Another alignment would change little.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Finish a&amp;s it is</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solve for the positions of the eyes.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer has verified and corrected the result. Finish, or measure more.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verified; the result is not used for every eye. Finish, or measure more.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not accepted yet. Add an alignment, or finish as it is.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>a fine-tuned φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the offline calibration&apos;s φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>an earlier φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press G to return.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reset φ in Fine-tune to return.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: drawn, saved and exported with {}; the verdict applies to the solved φ.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send to the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solve</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verify the {} eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand stays up while the headset receives its projections.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sending…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Waiting for the hand…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verify &amp;left eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solving…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the hand up and still to measure the error of the {} eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the hand up and still to measure the error of each eye, the {} first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Finish as it is</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Do not use this result. Follow the advice below, then add alignments.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verified before the alignments changed. Finish, or verify an eye again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Finish</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Add alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verify &amp;right eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset &amp;slipped</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show both in turn</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copy the result as text</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Bl&amp;ink before/after</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Print the result</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Print… (Ctrl+P)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, fine-tuned</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drawn and exported</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>with another φ, after going back</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copied: the result</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>without a name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One eye after the other</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Both eyes at once</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No image from the camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Camera: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset connected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset pose: {:.0f} Hz</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No pose from the headset yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Begin</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Close the {} eye. </source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}Move the hand until it lies under the cursor, then confirm in the headset.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand rotated by less than {:g}°</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the hand up, and look slowly to the left and to the right.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cursor shown for {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Make another cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Discards this cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Turned {:.1f}°: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Waiting for the headset to acknowledge its projections.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send the corrected projections to the headset.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep the offline calibration of {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keep offline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Do not use this result: keep the offline calibration of {}, and follow the advice below.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, then press {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last refused: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send the {} eye&apos;s projection; the {} eye keeps the offline calibration.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send the {} eye&apos;s projection; the {} eye keeps the offline calibration, because its result is {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Send {} eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Close the {} eye. Move the outline onto the hand: in the headset, or here with the arrow keys, + and −.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>It was moved aside on purpose: bringing it back is the evidence. {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Once more, to be sure. {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Outline shown for {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} eye&apos;s outline moved by {:.1f}′: {:.1f}′ {}, {:.1f}′ {}, size {}&#xa0;%</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Do not use this result. Finish, follow the advice below, and calibrate again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Everything is already saved. Finish the session when you are done.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solve the problem below, then finish the session.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials of {} are over the target. Add an alignment, or finish as it is.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The headset uses the offline calibration for {}: φ is 0 there.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{:.0f} to {:.0f} cm from the camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>at forearm&apos;s length, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The alignments have changed. Solve again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fini&amp;sh with one eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Align &amp;left eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Align &amp;right eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Raise the hand and hold it still to measure the error of the {} eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Raise the hand and hold it still to measure the error of each eye, the {} first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Skip</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Add alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Saved in {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>E&amp;xport…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The session is complete. Take the headset off, or continue with the next wearer.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The session is finished, its result not accepted: go back to measure more, or continue with the next wearer.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The session is finished, but trials of {} are over the target: go back to measure again, or continue with the next wearer.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Next wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not accepted. Go back to measure more, or finish as it is; all is saved.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials of {} are over the target. Go back to measure again, or finish as it is; all is saved.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Finish session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>up</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Put the headset on the wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Continue</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This session continues where it stopped, with {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Make sure that the headset sits well on the wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The former result is used again ({}): the wearer verifies each eye first, and alignments follow only if they are needed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} and wait until camera and headset are connected.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>down</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>It covers the hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Undo</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Redo</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Copy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Delete</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Find in sessions…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Find in sessions, or go to the search field of the window in front</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>both eyes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the {} eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Connect</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Align</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verify</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>confirm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>add an alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>redo</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>confirm the verification</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>undo the last nudge</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>skip the verification</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>take the next step</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>align the left eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>align the right eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>verify the left eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>verify the right eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>finish</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials are recorded once φ is solved, beside the panels: press F11, then T</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline up</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline down</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline far left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline far right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline far up</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move the outline far down</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Make the outline larger</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Make the outline smaller</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Draw with the previous φ, or with the newest again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Movement of the outline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hold: no step runs automatically; each waits for you (H)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hold the automatic steps, or let them run</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer confirms in the headset, or you:</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Draw with the offline calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer compares two drawings. Record the answer in Trials, or stop comparing.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer compares two drawings. Record the answer here, or stop comparing.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hold</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hold (H)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignments made, or eyes verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>aligned</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One eye after the other measures the position of each eye and takes two alignments.
Both eyes at once is quicker, but cannot measure an eye distance that differs from the rig&apos;s.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>E&amp;yes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Yes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Scale of depth</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth in metres. A hand is looked for from {:.2f} to {:.2f} m (colour). Grey: nearer or farther. Black: not measured.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This camera has no colour image.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Both</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Freeze</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Freeze the image (F)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Freeze the camera&apos;s image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Freeze (F)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Displayed image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the colour image, the depth image or both</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Next displayed image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save image…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Frozen</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>PNG images (*.png)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Colour image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Frames per second over the last second</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Time since the displayed frame arrived, in milliseconds</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Frames missing from the camera&apos;s own count since it started</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Age</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Dropped</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotated by {:.1f}°: too far</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>3D view of the hand cloud</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drag to rotate, drag with the right or middle button to move, scroll to zoom, double-click to reset the view. Keys: arrows, +, −, 1, 2, 3 and R.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotate left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotate right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotate up</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotate down</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Zoom in</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Zoom out</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Front</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Side</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Top</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand cloud will appear here. Hold a hand in front of the depth camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>mm from the depth camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>mm from the centre of the cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The live hand is rotated too far</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All points are hidden. Switch cursor or hand on below.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>As the wearer sees it (1)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>From the wearer&apos;s right (2)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>From above (3)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Oblique view of the whole scene (R, or double-click)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the frozen hand; the number of its points (C)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the hand; the number of its points (L)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>While aligning, join points of the live hand with the nearest points of the cursor once the hand is laid over it; updated twice a second (P)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>points</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show or hide: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>none</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Live hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pairs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to the right of the rig&apos;s viewpoint (φ1); negative is to the left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>below the rig&apos;s viewpoint (φ2); negative is above</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>in front of the rig&apos;s viewpoint, towards the display (φ3); negative is behind</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Shift of the drawn target to the right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Up</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Upward shift of the drawn target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Size</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Enlargement of the drawn target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The arrow keys move this eye (E changes)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} φ{} in millimetres</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}
The slider goes to ±{:g} mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the eye {}, in millimetres</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, relative to the φ compared with</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Confirm the alignment, solve and apply it first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solve and apply the alignment first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Apply the solved projections first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The headset is receiving the solved projections.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>An eye is being verified; confirm or skip that first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer compares two drawings: answer in Trials, or stop comparing.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sending to the headset…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In the headset. ← → φ1, ↑ ↓ φ2, PgUp PgDn φ3, E eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not acknowledged by the headset; see Link</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fine-tuning starts with a session.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The φ you set was replaced. Ctrl+Z brings it back.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The φ you set was replaced. Ctrl+6, then Ctrl+Z brings it back.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>against the offline φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Undo the last change</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Redo</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Redo the change</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Move both eyes by the same amount</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reset to solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reset to offline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Set φ to 0, the offline calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Offline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The calibrated φ is the one with which the headset draws after the calibration: the solved φ, or 0 for an eye that keeps the offline calibration. A trial records its error.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ctrl+6, then ← → φ1, ↑ ↓ φ2, PgUp PgDn φ3, E eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ctrl+6, then the keys above</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>against the calibrated φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Set φ to the one solved from the alignments, used or not</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the φ solved from the alignments, used or not, while checked</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show offline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show φ = 0 in the headset while checked</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Arrows move by {:g} mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Step of {:g} mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Other eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the target from the eye, in metres</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Next distance of the target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reset to</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Step</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Effect at</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The headset is not connected; see Link.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Latency history</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Latency, last {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Latency of the last {:g} s, in milliseconds</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Loss history</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Lost: — to, - - from</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Share of the datagrams of the last {:g} s that did not arrive: to the headset (solid line) and from it (dashed)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Latency</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Half the median time of a round trip to the headset, in milliseconds</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Clock</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset&apos;s clock minus this computer&apos;s, in seconds, and its uncertainty, in milliseconds</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Clock drift</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses received from the headset per second</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Data</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Kilobytes per second to the headset, over {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Kilobytes per second from the headset, over {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Lost</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Share of the datagrams to the headset that did not arrive, over {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Share of the headset&apos;s datagrams that did not arrive, over {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Resent</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fragments of messages retransmitted because they were not acknowledged in time</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Messages that the headset has not acknowledged yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In flight</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Failed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Messages that the headset did not acknowledge in time</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rejected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Datagrams that were not accepted, for the reasons below</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drift of the headset&apos;s clock over the last 30 seconds, in parts per million, and its uncertainty; positive is fast</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Signed with another pairing key: enter the key above in the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Damaged in transit, or not meant for handcal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Arrived twice or much too late; a few are normal in a wireless network</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Longer than the protocol allows: check the headset&apos;s program</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The headset&apos;s program uses another protocol version: update it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sent before the headset reconnected; a few are normal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>To headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>From headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rejected, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The new key must then be entered in the headset.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Host and port that the headset must connect to, by UDP</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;New key…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Make a new pairing key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pair a headset by QR code, and try it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Address</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not connected. Open a session on the start page.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Connect…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Res&amp;tart headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Restart the virtual headset&apos;s program</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Connected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not connected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>as published by Hu et al. 2021; slow.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the paper&apos;s model, solved with all three rows of each pair.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>exact model; robust to cut edges and a rotated hand; the default.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>rigid registration, the paper&apos;s baseline.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the same by Open3D, which must be installed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Comparison of methods</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Compare with method</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Compare</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ca&amp;ncel</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Δ: {} minus {}. σ and expected error are realistic only for “consistent”; the other methods&apos; are too small.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: {} Compare shows it beside the present results.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Cancel and close</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Keep running</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cance&amp;l</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Waiting for you</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Difference</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solving with {} …</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancelled.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Compare &amp;with</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance from the hand&apos;s points to their partners on the cursor at each iteration
of each alignment, root mean square.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Point RMS (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Surface RMS (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance from the hand&apos;s points to the cursor&apos;s surface, along its normals, at each
iteration of each alignment, root mean square. It is less than the Point RMS
among the numbers of each eye, which is to single points of the cursor.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Convergence</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Iteration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignment {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignments {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Results</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing is solved yet.

Each eye&apos;s position, its uncertainty and the verdict appear here once it is solved or verified.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>±: of measuring the hand in this alignment alone. That of the result also counts how well the wearer aligns.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Numbers of both eyes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Each alignment alone</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verdict</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reason</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copy as text</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copied: all numbers of the results</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Plots</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error against distance, and convergence of each registration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Residuals</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Single</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ of each alignment alone</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A line that ends level has converged.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignments</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Compare</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Residual map</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Right (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Down (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Residual (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignment and eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand as seen from the eye; a magenta × is a point without a partner (outlier).</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignment {}, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} Not solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not in any alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation of the hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation of the hand from the cursor, and its limit</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>limit {:.1f}°</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The alignment is confirmed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hold the hand in view of the camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The camera gives no image; the message below the guide says why.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand is rotated like the cursor.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: hand turned.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: moved too fast.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: shape changed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: no hand.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>While the wearer aligns, the hand&apos;s rotation from the cursor is shown here.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: headset&apos;s clock set.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: hand partly out of view.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last: the drawn φ had changed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation history</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last {:g} s</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>? No image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>? No hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>? Not placed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>▲ Shape differs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✓ Straight</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>▲ Turn back</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✓ Within limit</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} by {:.0f}°. {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No confirmation refused.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>confirmation</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>confirmations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} refused.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Direction to turn the hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Direction to turn the hand, as the wearer sees it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Notes on the session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Notes on this session; saved automatically</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This session is only shown. To write notes, resume it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>⚠ Too long by {:,} characters: not saved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✓ Saved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not saved yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance between the wearer&apos;s pupils in millimetres, by a ruler or pupillometer (± 1 mm);
empty: not measured. Alignments with both eyes open hardly show it.
A change discards the results: solve again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye distance in millimetres</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Confirmed alignments appear here once they are written</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials of the session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recorded trials appear here</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ of each alignment alone; the result is in Results</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>I&amp;nspect in 3D</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ex&amp;port…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} not written yet.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start or open a session to see it here</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, finished</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignments ({})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials ({})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error: between the calibrated φ and the fine-tuned one</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} (headset)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not measured</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not used: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the session&apos;s folder in the file manager</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show clouds, residuals, eyes and displays in a separate 3D window (needs Open3D)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Write a report, tables and calibration files</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye dis&amp;tance (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Notes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the eye distance must be a number; enter 45 to 85 mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sho&amp;w first</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sh&amp;ow second</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>First is be&amp;tter</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Se&amp;cond is better</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Neither</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the wearer the drawing without and with the calibration, in a hidden random order,
and record which fits the hand better. The report says which was which.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The wearer holds the hand up, and looks at both drawings. Then the answer can be recorded.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ask the wearer which drawing fits the hand better. Both can be shown again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the first and the second drawing before the answer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Blinded &amp;comparison</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Stop com&amp;paring</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} recorded</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>comparison</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>comparisons</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ of the {} has not been touched since its last trial at this distance. Press T again if this is a separate trial.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials appear here as they are recorded</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Statistics of trials</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A trial is the error of the calibrated φ relative to the φ with which the drawn target covers the real one. The calibrated φ is the solved one, or 0 for an eye that keeps the offline calibration.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ of the {} has not been fine-tuned: the error would be 0 px. Press T again if the wearer sees no error; fine-tune φ first otherwise.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the tar&amp;get in the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This session is only shown. To record trials, resume it or calibrate again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials are recorded while a session runs.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solve and apply the alignments first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Answer the comparison first, or stop it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The {} has not been aligned.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fine-tune φ of the {}, then record.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Next choice of the eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Record the error of the calibrated φ relative to the φ set by hand (T)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The eye that looks at the target; the other is closed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eyes in turn</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Draw the target for this eye, at this distance straight ahead, until a cursor is made or the session is finished</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Record trial</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Statistics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Plot</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Errors of trials</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the target (m)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error (′)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The error of each trial, the mean over the target&apos;s four corners. At each
distance: the mean of the n trials of both eyes, and one standard deviation (SD)
of the trials above and below it, but not below 0. A single trial has no SD.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean ± SD (≥ 0)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{:g} (n = {})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Left eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Right eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This eye&apos;s view will appear here. Hold a hand in front of the depth camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Closed: this alignment is for the other eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean distance between the hand&apos;s outline as the eye sees it and as {}, in the display&apos;s pixels and in minutes of arc (′)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand, and the target of a trial, as seen by the eye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drawn</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand and target as drawn by the headset; they cover the others if φ is right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The frozen hand as drawn by the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Before</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand&apos;s outline as drawn before calibration, with φ = 0</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Whole display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Before &amp;calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show each whole display instead of the part with the hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the headset draws it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>drawn before calibration (φ = 0)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Against solved φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, simulated</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, predicted</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, not solved yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The preferences could not be read and were reset: check the start page and Preferences (Ctrl+,) before you start. The old file is {}; the log beside it says what was wrong.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>there is no result yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>open a session first</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>there is no alignment yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing was exported: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing can be used: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>There is nothing to inspect: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The 3D window opens in a few seconds.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Next wearer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Open session…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Sessions…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Use in OpenXR programs…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Inspect in 3D</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Connect a &amp;headset…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Calibrate a rig…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>E&amp;valuate…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Preferences…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Quit</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Reset layout</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>They are lost if the calibration ends now. Cancel, and see to this first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Make a new pairing key? From the next calibration on, no headset connects until the new key is entered in it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>New key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A new pairing key was made. Enter it in the headsets before the next calibration.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Guide</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Manual</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset &amp;protocol</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Examples in Python</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Unity package</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Support bundle…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Keys</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Licences</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;About handcal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open a session&apos;s folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The preferences could not be saved: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Keys</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search (Ctrl+F)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search the keys</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No key contains these words.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Print…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Print all keys, or save them as PDF</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All keys, grouped by where they work.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Effect</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>About handcal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&lt;b&gt;handcal {}&lt;/b&gt;&lt;p&gt;Calibrates an optical see-through headset with the wearer&apos;s bare hand, after X. Hu, F. Rodriguez y Baena and F. Cutolo, ISMAR 2021.&lt;p&gt;Apache-2.0</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Close (Esc)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Close this message (Esc)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Consistent (recommended)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Linear</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rigid ICP</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rigid ICP by Open3D</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solver of the eye shift φ from an alignment.
Consistent: exact model; robust to cut edges and a rotated hand.
Linear: assumes a scale of 1, which underestimates φ3.
As in the paper: Hu et al. 2021; slow.
Rigid ICP: the paper&apos;s baseline; by Open3D the same, if it is installed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Colour and depth</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Colour and depth, leftmost</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Colour and depth, rightmost</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth alone</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Method of finding the hand.
Colour and depth: the hand detector selects where to search; of several hands
the nearest, or the leftmost or rightmost in the camera&apos;s image.
Depth alone: the nearest hand-sized object.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Limit of the hand&apos;s rotation from the cursor, in degrees; beyond it an alignment is refused.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Anything nearer to the camera is ignored; in metres.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Anything farther from the camera is ignored; in metres.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For the next calibrations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Rotation guard</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth gate &amp;from</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth gate &amp;to</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>“To” must be at least {:.2f} m larger than “from”.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Farthest distance of the hand from the depth camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Finds the hand in the camera&apos;s images.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Hand found by</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Computes where the eyes are from each alignment.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Solver</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand found by</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solver</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The hand may be rotated this much from the cursor.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nearest distance of the hand from the depth camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Good</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Problem</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Enter this key in the headset and nowhere else: any device with it can connect.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Co&amp;py</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show the pairing key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show &amp;key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copy the pairing key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copied: the pairing key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hide &amp;key</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RealSense, colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recording or video</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Recording or video, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No recording or video</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The camera&apos;s image will be shown here.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>choose the recording or video of the {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No image yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Camera {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>both are the same camera: choose another for one of them</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Opening the camera…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>handcal hit an unexpected error ({}: {})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Intrinsics (*.yaml *.yml *.xml *.json)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>File…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Folder…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} ({} in the field)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Delete</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Delete the selected row (Del); can be undone</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Scale of residuals</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of each point of the hand from its partner on the cursor after registration, in millimetres; outliers have no partner</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Residual 0</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Outlier</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This result, not used</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Before, expected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verification found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>After, expected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Verification</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One more alignment: {:.1f}′ expected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth error: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>none of this φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials, n = {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Target: {:.1f}′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solved: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Result</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>– Not solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>target {:g}′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✓ Accept</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>↻ Repeat</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>↩ Keep offline</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✕ Implausible</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✕ Contradicted</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ{} (mm)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the eye {} the rig&apos;s viewpoint,
± one standard deviation (σ). Both eyes are solved together:
an alignment of one may change the other, too.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to the right of</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>in front of</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>below</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Expected error</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Expected angle between real and drawn points at 0.4 to 0.6 m due to the uncertainty of φ,
in arcminutes. 1′ is 0.15 mm at 0.5 m.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance from the hand&apos;s points to their partners on the cursor after registration,
root mean square over the inliers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Inliers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Share of the hand&apos;s points with a partner on the cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error of this φ in the user-test trials, the mean, and their number; trials of an earlier φ
are only counted. ⚠: over the lab&apos;s target; look at the trials, and calibrate again if φ was
set well by hand.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} of earlier φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye distance, solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Learned prior</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not used</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not used: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, {} verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignments and verified eyes that were fused; solver: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ = ({}) mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>⚠ Trials over {:g}′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One more alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>learned from {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solved from</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Iterations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sum over all alignments</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Expected error after one more alignment like these</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance between the two solved eye positions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>⚠ {:.1f}′ n={}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{:.1f}′ n={}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Used in the results; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye distance measured</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Where eyes are expected before any alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>↻ Verify</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials found {:.1f}′: if φ was set carefully in them, measure again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One more alignment like these: expected error {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Number of the alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eyes open during the alignment</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation °</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Angle between hand and cursor at the confirmation, in degrees</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ1 mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ2 mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ3 mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Point RMS mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Inliers %</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Percentage of the hand&apos;s points with a partner on the cursor</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Time</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Time of the confirmation</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Number of the trial</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Eye that looked at the target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance m</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the target, in metres</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error px</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean over the target&apos;s four corners, in pixels of the display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean over the target&apos;s four corners, in arcminutes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Time of the recording</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Calibrations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>φ1, φ2 and φ3 of the eye from this alignment alone: its distance to the right of, below
and in front of the rig&apos;s viewpoint, in millimetres; the left eye above the right one</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance from the hand&apos;s points to their partners on the cursor, in millimetres</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>SD of trials ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>SD of calibrations ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Median ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Max ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Each trial counts once, with the mean of its corners, in arcminutes. Trials of one
calibration are not independent: only the spread between calibrations tells how the next
one turns out.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No trials yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, SD between trials {:.1f}′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>calibrations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} of {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: mean {:.1f}′{}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} One calibration cannot tell how the next one turns out.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} SD between calibrations {:.1f}′.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Undo</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignment {} deleted.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trial {} deleted.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Restore the deleted item (Ctrl+Z)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hand cloud</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Wearer&apos;s view</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Link</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;File</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Edit</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;View</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Help</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} – handcal</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Go to</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Station: only the guide</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Accepted</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not accepted</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Unfinished</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Unreadable</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Damaged, has a copy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Damaged: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Repaired copy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Unfinished, repaired copy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Finished</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not solved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Of the newest results; ⚠ trials of an accepted φ are over the lab&apos;s target on average</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Before ′
left / right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error expected without the calibration, left / right, in arcminutes:
the grey bars of the small picture</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>After ′
left / right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error that is left, as expected from all that is known, left / right, in arcminutes:
the coloured bars of the small picture</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials ′
left / right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name or code; of a session that cannot be read, its folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>⚠ {} n={}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} n={}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Date</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start, local time</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name of the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name of the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Found ′
left / right</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error of the calibration that the wearer&apos;s verification found, and corrected, left / right,
in arcminutes; – was not verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error of each eye&apos;s last calibrated φ relative to φ set by hand, left / right, in arcminutes:
the mean over its trials, and their numbers: 0 if all were of an earlier φ.
⚠ over the lab&apos;s target: look at the trials; if φ was set well by hand, calibrate again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Check lists what is damaged; Repair copies the rest</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Repaired in {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images to take</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>State</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>missing</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>taken</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trend</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Calibration of this wearer, oldest first</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Expected error in arcminutes; bars and brackets hold 95 %. Dashed: without the calibration. Only the eye&apos;s place is uncertain here: an error of the rig itself comes on top, and matters most far away.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Error against distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance (m)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Expected error (′)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, without</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, with</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Target</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, not verified</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: {} calibrations, and the error expected after each, verified by the wearer or not</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Noise study</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Method comparison</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The errors and effort of each method will be shown here, beside published ones.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cube test</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>How far is a drawn cube from the real one, as seen by a camera at the eye position? About a minute with rendered captures.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>How far the drawn cube is from the real one will be shown here, by axis and by position of the camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take the captures with a camera; enter their folder first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Track cube…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Track the cube with the depth camera, and have the headset draw it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>User test</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>How large are the errors that wearers see after calibration, over all trials of their sessions? A few seconds.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Capture…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>How much rotation and noise do the solvers tolerate before their error exceeds the 4 mm of Hu et al. 2021? About ten minutes on two cores; half a minute for a quick run.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The mean error of each solver over rotation and noise will be shown here, and up to where it stays within 4 mm.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Which calibration method is most accurate for the same simulated wearers, and how much effort does it require? 100 simulated wearers take about eleven minutes on two cores.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>To capture, choose a folder in Captures.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Record the trials of one session with a cube in the room; enter the session first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>To record, choose a session in Sessions.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Segmentation</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>How well does the segmented hand agree with true masks of your own camera&apos;s frames, and how stable is it? About a second per frame.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>there is no file {}: choose another, or leave the field empty</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>there is no folder {} yet: press Capture… to create it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>choose a session, or a folder of sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>there is no session in {}: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>a wearer without a name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>choose a folder of frames with true masks</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>there is no folder {}: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Full</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Quick</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A quick run uses few trials; do not report its numbers.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Si&amp;ze</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Simulated wearers; each uses every method.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Wearers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ca&amp;ptures</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>C&amp;ube</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Camera &amp;intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ri&amp;g file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Grid s&amp;quares</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Seed of the rendering</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses &amp;at each position</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Seed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Processes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Dask scheduler</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Results fold&amp;er</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Captures</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A frame NAME is NAME_depth.png, NAME_handmask.png and, if there is one, NAME_color.png; meta.json describes all frames: &lt;a href=&quot;{}&quot;&gt;its contents&lt;/a&gt;.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rendered by the simulator</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>POSITION/POSE/real.png and virtual.png, and POSITION/grid.png.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cube</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cubes (*.json)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>cube.json of the captures</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>camera.json of the captures</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Intrinsics of the camera at the eye position.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The example rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Side length of the squares of the display&apos;s grid.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses of the cube at each position, rendered or captured.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Alignments at each position, if captures are rendered.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The display in front of the camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The errors of all trials and of each wearer will be shown here, and where the corners were drawn.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Re&amp;cord trials…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>How well each frame agrees with its mask will be shown here, with pictures of where they differ.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the session of {} holds no trial: record some in the panel Trials, or press Record trials…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>no session in {} holds a trial: record some in the panel Trials, or choose one session and press Record trials…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Align&amp;ments per position</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Folder of one session, or a folder that contains sessions.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Frames</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>NAME_color.png, NAME_depth.png and NAME_handmask.png, and a meta.json.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Where the detector sees one</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nearest object, by depth alone</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fra&amp;mes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Hand</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Where the hand is looked for in a frame.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Number of processes on this computer; more than its cores is not faster.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One per core</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>None: this computer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Dask scheduler</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Address of a Dask cluster that does the work instead, such as tcp://HOST:PORT.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Random seed; the same seed gives the same numbers.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Results folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Report, figures and raw numbers; an unfinished study there is resumed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sessions shown</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} deleted.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} of {} sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, {} selected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} in {}{}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Reading {}…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Select a session and open it, or several, with Ctrl or Shift, to export, check or delete them.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search wearer, date, rig, headset (Ctrl+F)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name before: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Re&amp;store</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} (Ctrl+Z)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Correct the name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name or code of the wearer of {}:</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>path</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>paths</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copied: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Review the selected session (Return)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Name…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show &amp;folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cop&amp;y path</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Copy what is sound of a damaged session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>S&amp;how</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>C&amp;lose</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>This folder does not exist. Calibrate a wearer, which creates it, or choose another session folder on the start page.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No session matches. Search for something else, or choose All sessions.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A wider window also shows: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No session is in this folder yet. Calibrate a wearer, or choose another session folder on the start page.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Checking {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source> (and {} more)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} is running in this window. Finish it first.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} is open in another program. Close it there, then try again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>✓ {} sound, every file read.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>make it readable, or restore it from a backup</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>; select it alone, and Repair copies what is sound</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Repairing {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} is sound: there is nothing to repair.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} repaired: a copy with {} and {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Deleting {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Restoring {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Correcting {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name corrected in {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name removed from {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancelled: {} left out.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>and {} more</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Export the selected sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Correct the wearer&apos;s name or code in the selected sessions (F2)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Last deleted: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Select a wearer with several calibrations to see how the errors changed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} restored.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Read every file of the selected sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Check</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Re&amp;pair</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Delete the selected sessions (Del)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose a page, or search all</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing found: search for fewer or other words</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Manual</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search all pages (Ctrl+F)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Search all pages</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Lines found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Page</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Section</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Line</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Back</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Forward</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Contents</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>, the first {} listed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>line found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>lines found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>QR code</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Turned to the display&apos;s axes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Along the camera&apos;s axes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Close this window to choose the file under Camera intrinsics.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take captures</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Show</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A&amp;utomatically</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Automatically: stored images do not wait</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take each image once the cube or the grid is at rest. Between two images of the cube, cover it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Lar&amp;ge view</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fill the screen with the live image, to align a hand with it. Escape goes back.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Looking for cameras</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Checking the image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>waiting: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: capture the display&apos;s grid first</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>taken: {}, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>close this window to choose the files of the cube and the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not taken: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>press Show to open the camera again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All captures have been taken.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose the camera, and press Show.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Positions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Positions of the camera in the eye box: names of folders, separated by commas.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses of the cube at each position.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>One</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Renderings</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Names of the renderings to compare, such as: before, after.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>At &amp;each position</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Display&apos;s grid</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Without the grid, errors are measured along the camera&apos;s axes instead of the display&apos;s.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Positions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses &amp;at each</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Renderings</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Run</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Check the entries, then start at the lower right.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Change the entries for another study.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Change the entries, or run again if the files have changed.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Run again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} is running</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>only one can run at a time</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Done</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancelled; the next run starts from the beginning</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cancelled; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open &amp;report</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open in &amp;browser</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open &amp;folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Numbers {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Numbers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Figure or numbers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;View large</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fill the screen</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Terms and methods</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Escape goes back.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Click to fill the screen</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Report as PDF, for reading and archiving</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The same report as HTML, with the numbers of each figure</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Folder with report, figures and raw numbers as CSV</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Figure or &amp;numbers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>There is no room for: {}. View large, or open the report.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Figure {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drawn on white, as in the exported figures/{}.png.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>less than a minute left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>about {} h {} min left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>about {} min left</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Down</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Larger</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Smaller</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Put the cube {:g} m from the eyes, with two or three faces towards them.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>It is there</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: move the drawn corners until they cover the cube&apos;s.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>They coincide</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Record trials</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Paired headset, RealSense</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The simulator needs a session of a simulated wearer, who adjusts φ.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>60 mm cube</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Track the cube</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tracked &amp;by</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tracked by</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RealSense on a paired headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RealSense that does not move</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A headset draws the cube&apos;s edges where it stands in the room.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth camera, colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The camera&apos;s image and the cube&apos;s edges will be shown here.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pose of the cube</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Opening the camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tracking</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Stopped</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the cube is not tracked</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>or choose something else in Tracked by</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>waiting for the head&apos;s pose</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the cube is moving</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>From the camera, mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the cube is at rest</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose what tracks the cube and press Start.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Put the cube where the depth camera sees it. Press Stop to end.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>S&amp;top</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Filtered; from the cube&apos;s middle to the origin of the headset&apos;s world.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In the room, mm</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation vector, °</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Measured in this image; from the depth camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Trials recorded</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} ({:g} mm of φ)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Looking for the cube</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Storing the trial</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean error, px</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean error, ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Waiting for the headset</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean over the four corners.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>trials stored: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} is not one session</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>close this window and choose the wearer&apos;s session under Sessions</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} (simulated: {})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the session of {} holds no trial yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the session of {} holds {}; new ones are added</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Let the wearer put the headset on, and start.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The trials are stored. Close, or start again to add others.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Moves of φ</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Evaluations</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The entries are kept</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} is running. {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>If it is cancelled, its finished parts are kept.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} contains the complete study</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Show results</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>completed trials are kept</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} holds {:.0f} % of this study</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{:,} of {:,} cases</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>If it is cancelled, the next run starts from the beginning.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The report in {} will be replaced</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ready</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Corners</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Accept the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take &amp;grid…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>For each eye, put the viewpoint camera behind its display. In a dark room, take images of the grid. Do not move camera or headset: switch the display off, and take images of the board with both cameras at {} or more distances, 0.35 to 0.65 m. The rig passes if the drawn corners of the board lie, on average, within {:g}′ of those seen.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take &amp;board…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take g&amp;rid…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take bo&amp;ard…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drawn and seen corners</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Check the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>press Check the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Open re&amp;port</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Mean, ′ (at most {:g})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Largest, ′</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Looking for grid and board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>for one eye at least, take images of the grid and {} or more of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Viewpoint camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not accepted yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Check again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the rig fails: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} (step {})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the rig passes: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} left out, such as {}: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Grid: {} of 1 or more images. Board: {} of {} or more pairs.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Checkerboard</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Squares, not inner corners.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Kind of board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A ChArUco board may be partly hidden; a checkerboard must be seen whole.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Side length of a square, measured on the print.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Measured side length of a marker.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Dictionary</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Dictionary of the markers.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Boards with an even number of rows started with a white square.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Paper</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Size of the sheet of the PDF.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>To scale, with a ruler to check the print</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>PNG, to show on a screen</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use the e&amp;xample</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>no image shows this board yet: take images in the next step</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nothing of this rig is calibrated yet.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Start afresh from the example rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The example is in use</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Preview of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No such board exists</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The rig has not been saved; this will be lost: {}. Continue?</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save as &amp;PDF…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Print&amp;ed by OpenCV before 4.6</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save &amp;image…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Use another initial rig…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} inner corners</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, found in an image</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>PDF (*.pdf)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>PNG (*.png)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not saved: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>print it at 100 % and measure the ruler and the squares</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>saved as {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose an initial rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Use another initial rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In use: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Calibrated: {}.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Boar&amp;d</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>S&amp;quares</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Square</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Marker</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Di&amp;ctionary</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>P&amp;aper</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The initial rig provides what the headset itself reports: the size of its displays and the poses of its rendering cameras.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Coverage, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Number of images with a corner of the board in each part of the view. Empty parts give no information about the lens there.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the virtual screen</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the virtual screen from the viewpoint camera, z(C0→S): measured, for example by the camera&apos;s focus, or solved from the angle that a square subtends at the nominal distance.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Side length of the grid&apos;s squares, in pixels.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tracked poses</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tracked poses (*.json)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses of the board as tracked by the headset, for each image: {}, in metres.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Stereo calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Stereo calibrations (*.json)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not needed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Instead of images and poses of the board: the result of &apos;handcal rig stereo&apos; with the viewpoint camera as depth camera.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Matrices (*.txt *.json *.yaml *.yml)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rendering camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>As in the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Transform from the headset rig to this eye&apos;s rendering camera, T_V_H, as the headset reports it: 4 rows of 4 numbers, in metres; x right, y down, z forward. If empty, that of the initial rig is used.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Grid images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Board images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>measured</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>from the squares&apos; angle</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save the grid and show it on this display unscaled. With the viewpoint camera at the eye position, focused on the display, take 3 or more images in the dark.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Measured distance of the virtual screen, in metres.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Angle that a square of the grid subtends, in arcminutes.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nominal distance for this angle, from the manufacturer, in metres.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Instead of the images of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Screen&apos;s distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ta&amp;ke images…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images of t&amp;he grid</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Leave the camera in its place and switch the display off. Take 8 or more images of the board through it while the headset tracks the board. Save one JSON file with the name of each image and the pose of its board in the headset rig: &lt;a href=&quot;{}&quot;&gt;its contents&lt;/a&gt;.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images o&amp;f the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Poses of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>S&amp;tereo calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>R&amp;endering camera&apos;s pose</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>S&amp;creen&apos;s distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Me&amp;asured distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>An&amp;gle of a square</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nominal &amp;distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Find the grid &amp;again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Find t&amp;he board again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Ca&amp;mera pose</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Grid on the displa&amp;y</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>PNG, to show on the display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save &amp;grid…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to solve, take images of the grid, or choose their folder</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to solve, take images of the board, or choose their folder or a stereo calibration in Inputs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to solve, choose the file of the poses of the board in Inputs, or a stereo calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save the grid</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}×{} squares saved as {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>show it unscaled</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Item</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Expected</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Doubtful</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not known</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Drawing of the arrangement</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Find the board &amp;again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Map</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Uncertainty</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images of the board: how many cover each part of the view. Uncertainty: how well the solved projection is known there, in pixels.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Read the folders again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take images with cameras of this computer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Looking for the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} of {} used</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Take images…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No images yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The one that fits best</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No distortion</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>k1 to k6, p1, p2</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Fisheye</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solved from the images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>As OpenCV, ROS, Kalibr, RealSense, Open3D, Azure Kinect or handcal write them.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Lens</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distortion coefficients to solve for.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not judged: the file has no verdict</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the file cannot be read</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>solved with other inputs ({}): solve it again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>it was not added to the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>it was not added to the rig: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>it was added to the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>this rig is not plausible: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The entries could not be saved: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The entries were reset: {}; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The rig was reset: {}; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the old file was kept as {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the old file could not be renamed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Check of the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Numbers of the rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rig file to compare with</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Differences</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Check what the displays draw, with a camera at the eye position</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nam&amp;e</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, as in the initial rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}, partly as in the initial rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save the rig file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Enter a name of printable characters, to save the rig.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Save rig file…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Accept…</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Use for the next calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Save the rig file first</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>saved as {}; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>save it in another folder, or under another name</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>solved with the present inputs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Acceptance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not yet, or the rig has changed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the rig passes</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The rig is of mixed inputs. Save it nevertheless?

{}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the next calibration uses this rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>choose a rig file, such as the last calibration of this rig</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>compared with {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>C&amp;heck</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Nu&amp;mbers</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Com&amp;pare</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} failed</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} doubtful (see Check)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} not calibrated by handcal: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} not known or not made</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>none doubtful</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>save the rig file to use it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>solve these steps, or save the rig file to use it as it is</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>follow the advice under Acceptance, then accept the rig again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Value</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images left out, px</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Edge, px</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Focal length fx</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Focal length fy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Centre cx</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Centre cy</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation of the depth camera relative to the headset&apos;s camera, from T_H_D: axis times angle.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Position of the depth camera relative to the headset&apos;s camera, from T_H_D: x right, y down, z forward.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Position of the headset&apos;s rendering camera relative to the viewpoint of the offline calibration, t(C0→V): x right, y down, z forward.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distance of the virtual screen from the viewpoint of the offline calibration, z(C0→S).</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In pixels; σ from the residuals.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distortion {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Distortion coefficient of OpenCV&apos;s model.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pixel</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Angle of a pixel at the image centre.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images left out: RMS error on images that were not used to solve. Edge: standard deviation of a pixel at the edge of the image. The one chosen is ticked.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Each pair alone</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RMS difference from the pose by each pair alone.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>σ of the least certain corner of the display, in its pixels.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Focal length</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Focal length of K, on the display&apos;s axis.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Angle between the axes of the display and of the headset&apos;s V; included in H0.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Never negative; 0 if both agree.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth camera: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>From the depth camera&apos;s intrinsics.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rendering camera {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Rotation {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Position {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RMS</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Root mean square distance between detected and expected corners.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Unticked images are excluded; tick them to include them again.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Number of board corners found in each camera&apos;s image.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>RMS, px</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Root mean square distance between detected and expected corners, after solving.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Tilt</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Angle between the board&apos;s normal and the line of sight, after solving.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>worst: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>The selected image will appear here</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} corners; edges {:.1f} px wide</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Looking for the board in {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the viewpoint camera&apos;s intrinsics are missing: solve its step first</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solving</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Not solved yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Solve</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Lens models compared</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Solved {}: {}; {}; RMS {:.3f} px</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Worst: {}, {:.2f} px: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth imager&apos;s intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Needed only if the images come from a colour imager beside the depth imager and the depth is not aligned to it. Take images… reads them from a RealSense.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pose from depth to colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Poses (*.yaml *.yml *.json)</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take {} or more pairs of simultaneous images of the board: near and far, in all parts of both views, tilted by 20° to 45° in all directions. Give the two images of a pair the same name, or let them end in the same number, as depth07.png and headset07.png do.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Depth camera&apos;s images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Its in&amp;trinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth ima&amp;ger&apos;s intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>L&amp;ens</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Headset camera&apos;s images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Its intrinsi&amp;cs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Pose &amp;from depth to colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Headset camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Pairs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to solve, take pairs of images, or choose both folders in Inputs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>this has been taken already</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Near: seen from the front, the board would fill half of the width or more; far: a third or less. Tilted: by 20° or more from the line of sight.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take &amp;automatically when the board is still</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} of {} usable pairs of images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} tilted</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} near, {} far, {} tilted</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose the cameras and press Show.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Choose the camera and press Show.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press Take while nothing moves. Close when there are enough.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Images are taken automatically. Close when there are enough.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take an image whenever the board is at rest, sharp, and at a position not covered by earlier images.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} taken: enough images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} taken; {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} taken</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>press Show to open the cameras again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>take another</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} of {} usable images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Covered so far:</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source> and </source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: {} corners</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Uncertainty, {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Standard deviation of the pixel at which a distant point appears; dark from 1 px on. Take images with the board in the dark parts. Crossed: not known.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take {} or more images of the board with the viewpoint camera, with the focus that it will have behind the display: in all parts of the view up to its edges, tilted by 20° to 45° in all directions.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Viewpoint camera&apos;s images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Viewpoint images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>I&amp;mages</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the intrinsics are in {}: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>choose another file, or solve them</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to solve, take images of the board, or choose their folder in Inputs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>it is not used</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the displays will be calibrated with it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Print the board at 100 %, measure a square and enter its size.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Depth and headset camera</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Left display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>viewpoint camera&apos;s intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>depth camera&apos;s images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>headset camera&apos;s images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>depth camera&apos;s intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>headset camera&apos;s intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>depth imager&apos;s intrinsics</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>pose from depth to colour</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>lens</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>viewpoint camera&apos;s images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>images of the grid</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>grid squares</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>images of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>poses of the board</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>stereo calibration</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>rendering camera&apos;s pose</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>screen&apos;s distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>measured distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>angle of a square</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>nominal distance</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>excluded images</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Put the viewpoint camera behind the left display, take images of its grid and of the board, enter the screen&apos;s distance in Inputs, and solve.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Right display</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Do the same behind the right display: take images of its grid and of the board, enter the screen&apos;s distance in Inputs, and solve.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take images of the board with both cameras, and solve where the depth camera is on the headset.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>saved</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Take images of the board with the camera that later takes the eye&apos;s place, and solve its lens.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Name the rig, look at what is doubtful, save it, and use it.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Steps</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Next</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>All entries are kept</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>A step is being solved. If it is cancelled, its former result is kept.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Cl&amp;ose</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>not done yet</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>handcal hit an unexpected error ({})</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Bars: error before, after; left eye above</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Bars: expected error before, after; left eye above</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Bars of the small picture: the left eye above the right one, each with its error before
the calibration (grey) and after it (coloured; full if the eye is accepted, and no trials
are over the target). The whole
width is {:.0f}′.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}: {} before, {} after</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Hidden while the wearer compares</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>In the camera&apos;s image: {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Press the large button</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Changed to {}. {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Allowed: {} to {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Print</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{}; choose another file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Saved as {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>{} did not print; see whether it is connected, or print to a PDF file</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Sent to {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Set-&amp;up</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Inputs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Numbe&amp;rs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the board was found in no image: see the reason beside each</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>to solve, tick an image in which the board was found</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>At most {} characters; the rest is cut off</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No program opened it; the folder is at
{}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>No program opened it; the file is at
{}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Copy path</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>nothing was recorded: start again</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>the session is kept: resume it</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>handcal hit an unexpected error ({}); {}</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Arrow keys move the picture: ← → φ1, ↑ ↓ φ2; PgUp PgDn make it larger or smaller (φ3). E changes the eye.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Full size</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>handcal hit an unexpected error ({}: {}). Everything captured is saved; restart the program if it no longer works, and report it with Help &gt; Support bundle.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>no headset is paired; pair one with Connect a headset in the File menu</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>Every OpenXR program that you start on this computer then loads handcal&apos;s layer, which gives it the calibrated eyes of this wearer; Remove ends it for all.</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>OpenXR programs</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Keep it until it is replaced or the rig changes, not for 12 hours</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Use for every OpenXR program on this computer</source>
        <translation type="unfinished"></translation>
    </message>
    <message>
        <source>&amp;Remove</source>
        <translation type="unfinished"></translation>
    </message>
</context>
</TS>
