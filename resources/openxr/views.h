/* The calibrated views of a wearer's eyes in the place of a runtime's own. No files, clocks,
 * threads or allocations: an API layer (layer.c) or an app's own plug-in hooks two functions and
 * calls these.
 *
 * V is the runtime's own view of an eye, and poses are those of XrView. The calibrated eye lies at
 * a fixed pose in V, so its pose in any space follows from V's in that space, and V's from it. */
#ifndef HANDCAL_VIEWS_H
#define HANDCAL_VIEWS_H

#include <openxr/openxr.h>
#include <stdbool.h>
#include <stddef.h>

enum { HANDCAL_KEPT = 32, HANDCAL_VIEWS = 4, HANDCAL_LONGEST = 1 << 16 };

typedef struct {
    double pose[2][7];     /* each eye in V: x y z w, then metres */
    double edge[2][4];     /* its field of view: tangents left, right, up, down */
    double own_pose[2][7]; /* V in the rig's head, as the rig knows it */
    double own_edge[2][4]; /* V's field of view; all zero if the rig does not know it */
    double moving_eyes;    /* not 0: the runtime moves V with the wearer's eyes; head is VIEW */
    double image_m;        /* distance of the virtual image from the eyes */
    double expires_unix_s; /* 0: never */
    char system[XR_MAX_SYSTEM_NAME_SIZE]; /* the only headset that it is for; empty: told by its
                                             views */
} HandcalCalibration;

typedef enum {
    HANDCAL_WAITING, /* no frame has been seen */
    HANDCAL_ACTIVE,
    HANDCAL_OFF,            /* nothing to correct with */
    HANDCAL_OTHER_DISTANCE, /* refusals: `measured` says how far, in mm, or in 1e-3 of a tangent */
    HANDCAL_OTHER_DIRECTION,
    HANDCAL_OTHER_FIELD,
    HANDCAL_OTHER_VIEWS
} HandcalState;

typedef struct {
    HandcalState state;
    double measured;
    unsigned next;
    struct {
        bool is_used;
        uint32_t view;
        XrPosef given_pose, own_pose;
        XrFovf given_fov, own_fov;
        double offset[7]; /* the given view in the own one */
    } kept[HANDCAL_KEPT]; /* the newest views that an application was given */
} HandcalViews;

/* Reads a calibration file; NULL, or why it is refused, and then nothing is written to `to`. */
const char *handcal_read(const char *text, size_t length, HandcalCalibration *to);

/* Replaces what xrLocateViews returned, unless the views are not those of the calibration's rig.
 * `calibration` is NULL if nothing is to be corrected. `in_view` are the same views in VIEW space,
 * needed with moving eyes, else NULL. */
void handcal_locate(HandcalViews *views, const HandcalCalibration *calibration,
                    XrViewStateFlags flags, const XrView *in_view, uint32_t count, XrView *located);

/* Replaces a submitted view by the runtime's own, whatever part of it the application rendered. */
void handcal_submit(const HandcalViews *views, uint32_t view, XrPosef *pose, XrFovf *fov);

/* Moves the vertices of a visibility mask with the edges of the view. */
void handcal_mask(const HandcalViews *views, const HandcalCalibration *calibration, uint32_t view,
                  uint32_t count, XrVector2f *vertices);

#endif
