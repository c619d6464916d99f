/* The calibrated views for an app made with Unity: its plug-in for OpenXR looks up the runtime's
 * functions by the one that handcal_unity_hook returns (HandcalViews.cs). */
#define _GNU_SOURCE
#include "views.h"

#include <string.h>
#include <time.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#define EXPORT __declspec(dllexport)
static SRWLOCK gate = SRWLOCK_INIT;
#define lock() AcquireSRWLockExclusive(&gate)
#define unlock() ReleaseSRWLockExclusive(&gate)
typedef XrResult(XRAPI_PTR *Convert)(XrInstance, XrTime, LARGE_INTEGER *);
#else
#include <pthread.h>
#define EXPORT __attribute__((visibility("default")))
static pthread_mutex_t gate = PTHREAD_MUTEX_INITIALIZER;
#define lock() pthread_mutex_lock(&gate)
#define unlock() pthread_mutex_unlock(&gate)
typedef XrResult(XRAPI_PTR *Convert)(XrInstance, XrTime, struct timespec *);
#endif

enum { MOST_LAYERS = 128, MOST_PROJECTIONS = 16, EYE_NUMBERS = 14, OWN_NUMBERS = 11 };

/* Unity has one instance and one session at a time. */
static struct {
    PFN_xrGetInstanceProcAddr get;
    PFN_xrCreateSession create_session;
    PFN_xrLocateViews locate_views;
    PFN_xrEndFrame end_frame;
    PFN_xrWaitFrame wait_frame;
    PFN_xrGetVisibilityMaskKHR get_mask;
    XrInstance instance;
    XrSpace head;
    XrTime display_time;
    HandcalViews views;
    HandcalCalibration calibration;
    bool is_calibrated, has_own;
    XrView own[2]; /* in VIEW */
} g;

static XrResult XRAPI_CALL CreateSession(XrInstance instance, const XrSessionCreateInfo *info, XrSession *session) {
    const XrResult result = g.create_session(instance, info, session);
    PFN_xrCreateReferenceSpace create_space = NULL;
    const XrReferenceSpaceCreateInfo view = {XR_TYPE_REFERENCE_SPACE_CREATE_INFO, NULL, XR_REFERENCE_SPACE_TYPE_VIEW, {{0, 0, 0, 1}, {0, 0, 0}}};
    XrSpace head = XR_NULL_HANDLE;
    if (XR_FAILED(result)) return result;
    g.get(instance, "xrCreateReferenceSpace", (PFN_xrVoidFunction *)&create_space);
    if (!create_space || XR_FAILED(create_space(*session, &view, &head))) head = XR_NULL_HANDLE;
    lock();
    g.instance = instance;
    g.head = head; /* it ends with the session */
    memset(&g.views, 0, sizeof g.views);
    g.display_time = 0;
    g.has_own = false;
    unlock();
    return result;
}

static XrResult XRAPI_CALL WaitFrame(XrSession session, const XrFrameWaitInfo *info, XrFrameState *state) {
    const XrResult result = g.wait_frame(session, info, state);
    lock();
    if (XR_SUCCEEDED(result)) g.display_time = state->predictedDisplayTime;
    unlock();
    return result;
}

static XrResult XRAPI_CALL LocateViews(XrSession session, const XrViewLocateInfo *info, XrViewState *state,
                                       uint32_t capacity, uint32_t *count, XrView *views) {
    const XrResult result = g.locate_views(session, info, state, capacity, count, views);
    const bool is_two = info->viewConfigurationType == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO && *count == 2;
    const bool is_four = info->viewConfigurationType == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_QUAD_VARJO && *count == 4;
    if (XR_FAILED(result) || !views || capacity < *count || !(is_two || is_four)) return result;
    const XrViewStateFlags whole = XR_VIEW_STATE_ORIENTATION_VALID_BIT | XR_VIEW_STATE_POSITION_VALID_BIT;
    const XrViewLocateInfo there = {XR_TYPE_VIEW_LOCATE_INFO, NULL, info->viewConfigurationType, info->displayTime, g.head};
    XrViewState found = {.type = XR_TYPE_VIEW_STATE};
    XrView in_head[HANDCAL_VIEWS];
    uint32_t number = 0;
    for (int i = 0; i < HANDCAL_VIEWS; i++) in_head[i] = (XrView){.type = XR_TYPE_VIEW};
    const bool has_head = g.head != XR_NULL_HANDLE
        && XR_SUCCEEDED(g.locate_views(session, &there, &found, HANDCAL_VIEWS, &number, in_head))
        && number == *count && (found.viewStateFlags & whole) == whole;
    lock();
    if (has_head) memcpy(g.own, in_head, sizeof g.own);
    g.has_own |= has_head;
    handcal_locate(&g.views, g.is_calibrated ? &g.calibration : NULL, state->viewStateFlags, has_head ? in_head : NULL, *count, views);
    unlock();
    return result;
}

static XrResult XRAPI_CALL EndFrame(XrSession session, const XrFrameEndInfo *info) {
    const XrCompositionLayerBaseHeader *layers[MOST_LAYERS];
    XrCompositionLayerProjection projections[MOST_PROJECTIONS];
    XrCompositionLayerProjectionView views[MOST_PROJECTIONS][HANDCAL_VIEWS];
    int used = 0;
    if (info->layerCount > MOST_LAYERS) return XR_ERROR_LAYER_LIMIT_EXCEEDED;
    lock();
    for (uint32_t k = 0; k < info->layerCount; k++) {
        const XrCompositionLayerProjection *in = (const XrCompositionLayerProjection *)info->layers[k];
        layers[k] = info->layers[k];
        if (!in || in->type != XR_TYPE_COMPOSITION_LAYER_PROJECTION || (in->viewCount != 2 && in->viewCount != 4)) continue;
        if (used == MOST_PROJECTIONS) { unlock(); return XR_ERROR_LAYER_LIMIT_EXCEEDED; }
        projections[used] = *in;
        projections[used].views = views[used];
        for (uint32_t i = 0; i < in->viewCount; i++) {
            views[used][i] = in->views[i];
            handcal_submit(&g.views, i, &views[used][i].pose, &views[used][i].fov);
        }
        layers[k] = (const XrCompositionLayerBaseHeader *)&projections[used++];
    }
    unlock();
    XrFrameEndInfo out = *info;
    if (info->layerCount) out.layers = layers;
    return g.end_frame(session, &out);
}

static XrResult XRAPI_CALL GetVisibilityMask(XrSession session, XrViewConfigurationType configuration, uint32_t view,
                                             XrVisibilityMaskTypeKHR type, XrVisibilityMaskKHR *mask) {
    const XrResult result = g.get_mask(session, configuration, view, type, mask);
    if (XR_FAILED(result) || view >= HANDCAL_VIEWS || !mask->vertices || mask->vertexCapacityInput < mask->vertexCountOutput) return result;
    lock();
    handcal_mask(&g.views, g.is_calibrated ? &g.calibration : NULL, view, mask->vertexCountOutput, mask->vertices);
    unlock();
    return result;
}

static XrResult XRAPI_CALL GetInstanceProcAddr(XrInstance instance, const char *name, PFN_xrVoidFunction *function) {
    const struct { const char *name; PFN_xrVoidFunction *next, own; } hooks[] = {
        {"xrCreateSession", (PFN_xrVoidFunction *)&g.create_session, (PFN_xrVoidFunction)CreateSession},
        {"xrWaitFrame", (PFN_xrVoidFunction *)&g.wait_frame, (PFN_xrVoidFunction)WaitFrame},
        {"xrLocateViews", (PFN_xrVoidFunction *)&g.locate_views, (PFN_xrVoidFunction)LocateViews},
        {"xrEndFrame", (PFN_xrVoidFunction *)&g.end_frame, (PFN_xrVoidFunction)EndFrame},
        {"xrGetVisibilityMaskKHR", (PFN_xrVoidFunction *)&g.get_mask, (PFN_xrVoidFunction)GetVisibilityMask}};
    const XrResult result = g.get(instance, name, function);
    for (size_t i = 0; XR_SUCCEEDED(result) && i < sizeof hooks / sizeof *hooks; i++)
        if (!strcmp(name, hooks[i].name)) {
            *hooks[i].next = *function;
            *function = hooks[i].own;
        }
    return result;
}

/* Returns the function that Unity looks all others up by, in the place of `next`. */
EXPORT PFN_xrGetInstanceProcAddr handcal_unity_hook(PFN_xrGetInstanceProcAddr next) {
    g.get = next;
    return GetInstanceProcAddr;
}

/* Renders with a calibration from the next frame on; NULL: with the runtime's own views. For each
 * eye its place in V, the tangents of its field of view (left, right, up, down), and the pose of V
 * in the rig's head: metres, and a quaternion x y z w before. OpenXR's axes. */
EXPORT void handcal_unity_calibrate(const double *eyes, int moves_views) {
    HandcalCalibration made = {.moving_eyes = moves_views};
    for (int eye = 0; eyes && eye < 2; eye++) {
        const double *one = eyes + EYE_NUMBERS * eye;
        made.pose[eye][3] = 1.0;
        memcpy(made.pose[eye] + 4, one, 3 * sizeof *one);
        memcpy(made.edge[eye], one + 3, sizeof made.edge[eye]);
        memcpy(made.own_pose[eye], one + 7, sizeof made.own_pose[eye]);
    }
    lock();
    g.calibration = made;
    g.is_calibrated = eyes != NULL;
    unlock();
}

/* What became of it: a HandcalState, and for a refusal how far it is off. */
EXPORT int handcal_unity_state(double *measured) {
    lock();
    const HandcalState state = g.views.state;
    *measured = g.views.measured;
    unlock();
    return state;
}

/* The runtime's own views of both eyes in the head (VIEW): quaternion x y z w, metres, and the angles
 * left, right, up, down of the field of view, rad. 0 until they are known. */
EXPORT int handcal_unity_own(float *to) {
    lock();
    for (int eye = 0; eye < 2; eye++) {
        memcpy(to + OWN_NUMBERS * eye, &g.own[eye].pose, sizeof(XrPosef));
        memcpy(to + OWN_NUMBERS * eye + 7, &g.own[eye].fov, sizeof(XrFovf));
    }
    const int is_known = g.has_own;
    unlock();
    return is_known;
}

/* The time that the newest frame will be displayed at, ns, on the clock of .NET's Stopwatch; 0: not known. */
EXPORT int64_t handcal_unity_display_time_ns(void) {
    lock();
    const XrTime time = g.display_time;
    const XrInstance instance = g.instance;
    unlock();
    if (!time) return 0;
#ifdef _WIN32
    Convert convert = NULL;
    LARGE_INTEGER count, hz;
    g.get(instance, "xrConvertTimeToWin32PerformanceCounterKHR", (PFN_xrVoidFunction *)&convert);
    if (!convert || XR_FAILED(convert(instance, time, &count)) || !QueryPerformanceFrequency(&hz)) return 0;
    return (int64_t)((double)count.QuadPart * (1e9 / (double)hz.QuadPart));
#else
    Convert convert = NULL;
    struct timespec monotonic;
    g.get(instance, "xrConvertTimeToTimespecTimeKHR", (PFN_xrVoidFunction *)&convert);
    if (!convert || XR_FAILED(convert(instance, time, &monotonic))) return 0;
    return (int64_t)monotonic.tv_sec * 1000000000 + monotonic.tv_nsec;
#endif
}
