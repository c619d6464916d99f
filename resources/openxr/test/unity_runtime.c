/* A runtime and Unity's plug-in for OpenXR, as unity.c meets them: one session, a head that moves. */
#define _GNU_SOURCE
#include <math.h>
#include <openxr/openxr.h>
#include <string.h>
#include <time.h>

enum { LOCAL, VIEW = XR_REFERENCE_SPACE_TYPE_VIEW };
static XrView in_head[2];
static XrPosef head;
static XrCompositionLayerProjectionView received[2];

static XrVector3f rotated(XrQuaternionf q, XrVector3f v) {
    const XrVector3f t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
    return (XrVector3f){v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z,
                        v.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

static XrPosef product(XrPosef a, XrPosef b) {
    const XrQuaternionf p = a.orientation, q = b.orientation;
    const XrVector3f at = rotated(p, b.position);
    return (XrPosef){{p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y, p.w * q.y + p.y * q.w + p.z * q.x - p.x * q.z,
                      p.w * q.z + p.z * q.w + p.x * q.y - p.y * q.x, p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z},
                     {a.position.x + at.x, a.position.y + at.y, a.position.z + at.z}};
}

static XrResult XRAPI_CALL CreateSession(XrInstance instance, const XrSessionCreateInfo *info, XrSession *session) {
    (void)instance, (void)info;
    *session = (XrSession)1;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL CreateReferenceSpace(XrSession session, const XrReferenceSpaceCreateInfo *info, XrSpace *space) {
    (void)session;
    *space = (XrSpace)(uintptr_t)info->referenceSpaceType;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL WaitFrame(XrSession session, const XrFrameWaitInfo *info, XrFrameState *state) {
    static float turn;
    struct timespec now;
    (void)session, (void)info;
    turn += 0.02f;
    head = (XrPosef){{0.6f * sinf(turn), 0, 0, sqrtf(1 - 0.36f * sinf(turn) * sinf(turn))}, {turn, 1.6f, -0.3f}};
    clock_gettime(CLOCK_MONOTONIC, &now);
    state->predictedDisplayTime = (XrTime)now.tv_sec * 1000000000 + now.tv_nsec + 40000000;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL ConvertTime(XrInstance instance, XrTime time, struct timespec *to) {
    (void)instance;
    *to = (struct timespec){time / 1000000000, time % 1000000000};
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL LocateViews(XrSession session, const XrViewLocateInfo *info, XrViewState *state,
                                       uint32_t capacity, uint32_t *count, XrView *views) {
    (void)session, (void)capacity;
    *count = 2;
    state->viewStateFlags = XR_VIEW_STATE_ORIENTATION_VALID_BIT | XR_VIEW_STATE_POSITION_VALID_BIT;
    memcpy(views, in_head, sizeof in_head);
    for (int i = 0; i < 2 && info->space != (XrSpace)VIEW; i++) views[i].pose = product(head, in_head[i].pose);
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL EndFrame(XrSession session, const XrFrameEndInfo *info) {
    (void)session;
    memcpy(received, ((const XrCompositionLayerProjection *)info->layers[0])->views, sizeof received);
    return XR_SUCCESS;
}

XrResult XRAPI_CALL test_get(XrInstance instance, const char *name, PFN_xrVoidFunction *function) {
    static const struct { const char *name; PFN_xrVoidFunction function; } all[] = {
        {"xrCreateSession", (PFN_xrVoidFunction)CreateSession}, {"xrWaitFrame", (PFN_xrVoidFunction)WaitFrame},
        {"xrCreateReferenceSpace", (PFN_xrVoidFunction)CreateReferenceSpace}, {"xrLocateViews", (PFN_xrVoidFunction)LocateViews},
        {"xrEndFrame", (PFN_xrVoidFunction)EndFrame}, {"xrConvertTimeToTimespecTimeKHR", (PFN_xrVoidFunction)ConvertTime}};
    (void)instance;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (!strcmp(name, all[i].name)) {
            *function = all[i].function;
            return XR_SUCCESS;
        }
    return XR_ERROR_FUNCTION_UNSUPPORTED;
}

/* The runtime's own views in the head: pose and angles, 11 numbers for each eye. */
void test_views(const float *numbers) {
    for (int i = 0; i < 2; i++) {
        memcpy(&in_head[i].pose, numbers + 11 * i, sizeof(XrPosef));
        memcpy(&in_head[i].fov, numbers + 11 * i + 7, sizeof(XrFovf));
    }
}

/* Draws a frame as Unity does. 11 numbers for each eye: the views that it gets, in its space; those
 * that the runtime receives; and the runtime's own. */
void test_frame(PFN_xrGetInstanceProcAddr get, float *to) {
    static PFN_xrCreateSession create;
    static PFN_xrWaitFrame wait;
    static PFN_xrLocateViews locate;
    static PFN_xrEndFrame end;
    static XrSession session;
    if (!session) {
        get(NULL, "xrCreateSession", (PFN_xrVoidFunction *)&create);
        get(NULL, "xrWaitFrame", (PFN_xrVoidFunction *)&wait);
        get(NULL, "xrLocateViews", (PFN_xrVoidFunction *)&locate);
        get(NULL, "xrEndFrame", (PFN_xrVoidFunction *)&end);
        create(NULL, NULL, &session);
    }
    XrFrameState frame = {.type = XR_TYPE_FRAME_STATE};
    XrViewLocateInfo info = {.viewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO, .space = (XrSpace)LOCAL};
    XrViewState state = {.type = XR_TYPE_VIEW_STATE};
    XrView views[2], own[2];
    uint32_t count;
    wait(session, NULL, &frame);
    locate(session, &info, &state, 2, &count, views);
    LocateViews(session, &info, &state, 2, &count, own);
    XrCompositionLayerProjectionView drawn[2] = {{.pose = views[0].pose, .fov = views[0].fov}, {.pose = views[1].pose, .fov = views[1].fov}};
    const XrCompositionLayerProjection layer = {.type = XR_TYPE_COMPOSITION_LAYER_PROJECTION, .viewCount = 2, .views = drawn};
    const XrCompositionLayerBaseHeader *layers[] = {(const XrCompositionLayerBaseHeader *)&layer};
    const XrFrameEndInfo submitted = {.type = XR_TYPE_FRAME_END_INFO, .layerCount = 1, .layers = layers};
    end(session, &submitted);
    for (int i = 0; i < 2; i++, to += 11) {
        memcpy(to, &views[i].pose, sizeof(XrPosef)), memcpy(to + 7, &views[i].fov, sizeof(XrFovf));
        memcpy(to + 22, &received[i].pose, sizeof(XrPosef)), memcpy(to + 29, &received[i].fov, sizeof(XrFovf));
        memcpy(to + 44, &own[i].pose, sizeof(XrPosef)), memcpy(to + 51, &own[i].fov, sizeof(XrFovf));
    }
}
