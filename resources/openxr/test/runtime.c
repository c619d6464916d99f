/* A headless OpenXR runtime for the tests: its head moves, its views are those in the environment,
 * and it writes down what it receives. Swapchains and graphics are not there.
 *   TEST_VIEWS     for each view x y z w, metres in VIEW space, and angles left right up down
 *   TEST_TURNED_S  from this display time on, the right views are 2 mm farther to the right
 *   TEST_SYSTEM    the headset's name
 *   TEST_EXTENSION one extension more
 *   TEST_RECORD    file for what xrEndFrame received */
#include "../loader.h"

#include <locale.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { HEAD_SPACE = 1 << 30 }; /* in the handle of a VIEW space */
static uint64_t last_handle = 0x1000;
static XrView views[4];
static uint32_t view_count;
static double turned_s = 1e30;
static FILE *record;
static bool is_ready;

#define NEW(type) ((type)(uintptr_t)++last_handle)

static XrPosef multiply(XrPosef a, XrPosef b) {
    const double x = a.orientation.x, y = a.orientation.y, z = a.orientation.z, w = a.orientation.w;
    const XrQuaternionf q = b.orientation;
    const XrVector3f v = b.position;
    const double tx = 2 * (y * v.z - z * v.y), ty = 2 * (z * v.x - x * v.z),
                 tz = 2 * (x * v.y - y * v.x);
    XrPosef to;
    to.orientation.x = (float)(w * q.x + x * q.w + y * q.z - z * q.y);
    to.orientation.y = (float)(w * q.y - x * q.z + y * q.w + z * q.x);
    to.orientation.z = (float)(w * q.z + x * q.y - y * q.x + z * q.w);
    to.orientation.w = (float)(w * q.w - x * q.x - y * q.y - z * q.z);
    to.position.x = (float)(a.position.x + v.x + w * tx + y * tz - z * ty);
    to.position.y = (float)(a.position.y + v.y + w * ty + z * tx - x * tz);
    to.position.z = (float)(a.position.z + v.z + w * tz + x * ty - y * tx);
    return to;
}

/* The head in LOCAL space: it turns and walks, with its head 1.7 m above the floor. */
static XrPosef head(XrTime time) {
    const double t = 1e-9 * (double)time, a = 0.4 * sin(1.3 * t), b = 0.3 * sin(0.9 * t + 1);
    const XrPosef yaw = {{0, (float)sin(a), 0, (float)cos(a)},
                         {(float)(1.5 * sin(0.7 * t)), 1.7f, (float)cos(t)}};
    const XrPosef pitch = {{(float)sin(b), 0, 0, (float)cos(b)}, {0, 0, 0}};
    return multiply(yaw, pitch);
}

static XrView own_view(XrSpace space, XrTime time, uint32_t i) {
    XrView view = views[i];
    if (i % 2 && 1e-9 * (double)time >= turned_s) view.pose.position.x += 0.002f;
    if (!((uintptr_t)space & HEAD_SPACE)) view.pose = multiply(head(time), view.pose);
    return view;
}

static XrResult XRAPI_CALL EnumerateInstanceExtensionProperties(const char *layer,
                                                                uint32_t capacity, uint32_t *count,
                                                                XrExtensionProperties *to) {
    const char *names[] = {"XR_MND_headless", XR_KHR_VISIBILITY_MASK_EXTENSION_NAME,
                           "XR_VARJO_quad_views", getenv("TEST_EXTENSION")};
    (void)layer;
    *count = names[3] ? 4 : 3;
    if (capacity == 0) return XR_SUCCESS;
    if (capacity < *count) return XR_ERROR_SIZE_INSUFFICIENT;
    for (uint32_t i = 0; i < *count; i++) {
        snprintf(to[i].extensionName, sizeof to[i].extensionName, "%s", names[i]);
        to[i].extensionVersion = 1;
    }
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL CreateInstance(const XrInstanceCreateInfo *info, XrInstance *to) {
    XrExtensionProperties known[4];
    uint32_t count = 0;
    EnumerateInstanceExtensionProperties(NULL, 4, &count, known);
    for (uint32_t i = 0; i < info->enabledExtensionCount; i++) {
        bool is_known = false;
        for (uint32_t k = 0; k < count; k++)
            is_known |= !strcmp(info->enabledExtensionNames[i], known[k].extensionName);
        if (!is_known) return XR_ERROR_EXTENSION_NOT_PRESENT;
    }
    char *at = getenv("TEST_VIEWS");
    char locale[100]; /* of the application, which does not concern strtod below */
    snprintf(locale, sizeof locale, "%s", setlocale(LC_NUMERIC, NULL));
    setlocale(LC_NUMERIC, "C");
    for (view_count = 0; at && view_count < 4; view_count++) {
        double n[11];
        char *end = at;
        for (int i = 0; i < 11; i++) n[i] = strtod(at = end, &end);
        if (end == at) break;
        at = end;
        views[view_count] = (XrView){XR_TYPE_VIEW,
                                     NULL,
                                     {{(float)n[0], (float)n[1], (float)n[2], (float)n[3]},
                                      {(float)n[4], (float)n[5], (float)n[6]}},
                                     {(float)n[7], (float)n[8], (float)n[9], (float)n[10]}};
    }
    if (getenv("TEST_TURNED_S")) turned_s = strtod(getenv("TEST_TURNED_S"), NULL);
    setlocale(LC_NUMERIC, locale);
    if (getenv("TEST_RECORD") && !record) record = fopen(getenv("TEST_RECORD"), "w");
    *to = NEW(XrInstance);
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL DestroyInstance(XrInstance i) {
    (void)i;
    if (record) fflush(record);
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL GetInstanceProperties(XrInstance i, XrInstanceProperties *to) {
    (void)i;
    to->runtimeVersion = XR_MAKE_VERSION(1, 0, 0);
    strcpy(to->runtimeName, "handcal test runtime");
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL GetSystem(XrInstance i, const XrSystemGetInfo *info, XrSystemId *to) {
    (void)i, (void)info;
    *to = 1;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL GetSystemProperties(XrInstance i, XrSystemId id,
                                               XrSystemProperties *to) {
    (void)i;
    const char *name = getenv("TEST_SYSTEM");
    to->systemId = id;
    to->vendorId = 1;
    snprintf(to->systemName, sizeof to->systemName, "%s", name ? name : "test headset");
    to->graphicsProperties = (XrSystemGraphicsProperties){4096, 4096, 16};
    to->trackingProperties = (XrSystemTrackingProperties){XR_TRUE, XR_TRUE};
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL EnumerateReprojectionModes(XrInstance i, XrSystemId id,
                                                      XrViewConfigurationType type,
                                                      uint32_t capacity, uint32_t *count,
                                                      XrReprojectionModeMSFT *modes) {
    (void)i, (void)id, (void)type;
    *count = 1;
    if (capacity) modes[0] = XR_REPROJECTION_MODE_PLANAR_MANUAL_MSFT;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL CreateSession(XrInstance i, const XrSessionCreateInfo *info,
                                         XrSession *to) {
    (void)i, (void)info;
    is_ready = true;
    *to = NEW(XrSession);
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL DestroySession(XrSession s) {
    (void)s;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL BeginSession(XrSession s, const XrSessionBeginInfo *info) {
    (void)s, (void)info;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL EndSession(XrSession s) {
    (void)s;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL BeginFrame(XrSession s, const XrFrameBeginInfo *info) {
    (void)s, (void)info;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL WaitFrame(XrSession s, const XrFrameWaitInfo *info, XrFrameState *to) {
    static XrTime time = 1000000000;
    (void)s, (void)info;
    to->predictedDisplayTime = __atomic_add_fetch(&time, 11111111, __ATOMIC_RELAXED);
    to->predictedDisplayPeriod = 11111111;
    to->shouldRender = XR_TRUE;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL CreateReferenceSpace(XrSession s, const XrReferenceSpaceCreateInfo *info,
                                                XrSpace *to) {
    (void)s;
    *to = NEW(XrSpace);
    if (info->referenceSpaceType == XR_REFERENCE_SPACE_TYPE_VIEW)
        *to = (XrSpace)((uintptr_t)*to | HEAD_SPACE);
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL DestroySpace(XrSpace s) {
    (void)s;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL LocateSpace(XrSpace space, XrSpace base, XrTime time,
                                       XrSpaceLocation *to) {
    (void)space, (void)base;
    to->pose = head(time);
    to->locationFlags = 15;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL LocateViews(XrSession s, const XrViewLocateInfo *info,
                                       XrViewState *state, uint32_t capacity, uint32_t *count,
                                       XrView *to) {
    (void)s;
    *count = info->viewConfigurationType == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_QUAD_VARJO ? 4 : 2;
    if (capacity == 0) return XR_SUCCESS;
    if (capacity < *count) return XR_ERROR_SIZE_INSUFFICIENT;
    state->viewStateFlags = 15;
    for (uint32_t i = 0; i < *count; i++) {
        const XrView view = own_view(info->space, info->displayTime, i);
        to[i].pose = view.pose;
        to[i].fov = view.fov;
    }
    return XR_SUCCESS;
}

/* The own and the received view in one line, whichever threads write. */
static void write_views(XrTime time, uint32_t i, const XrView own, XrPosef pose, XrFovf fov) {
    char text[2][300];
    const XrPosef poses[2] = {own.pose, pose};
    const XrFovf fovs[2] = {own.fov, fov};
    for (int k = 0; k < 2; k++) {
        const XrPosef p = poses[k];
        const XrFovf f = fovs[k];
        snprintf(text[k], sizeof text[k],
                 "%.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g", p.orientation.x,
                 p.orientation.y, p.orientation.z, p.orientation.w, p.position.x, p.position.y,
                 p.position.z, f.angleLeft, f.angleRight, f.angleUp, f.angleDown);
    }
    fprintf(record, "received %.9f %u %s %s\n", 1e-9 * (double)time, i, text[0], text[1]);
}

static XrResult XRAPI_CALL EndFrame(XrSession s, const XrFrameEndInfo *info) {
    (void)s;
    for (uint32_t k = 0; record && k < info->layerCount; k++) {
        const XrCompositionLayerProjection *layer =
            (const XrCompositionLayerProjection *)info->layers[k];
        if (layer->type != XR_TYPE_COMPOSITION_LAYER_PROJECTION) {
            fprintf(record, "other %d\n", layer->type);
            continue;
        }
        for (uint32_t i = 0; i < layer->viewCount; i++) {
            const XrView own = own_view(layer->space, info->displayTime, i);
            write_views(info->displayTime, i, own, layer->views[i].pose, layer->views[i].fov);
        }
        for (const XrBaseInStructure *one = layer->next; one; one = one->next)
            if (one->type == XR_TYPE_COMPOSITION_LAYER_REPROJECTION_PLANE_OVERRIDE_MSFT) {
                const XrCompositionLayerReprojectionPlaneOverrideMSFT *p = (const void *)one;
                fprintf(record, "plane %.9g %.9g %.9g %.9g %.9g %.9g\n", p->position.x,
                        p->position.y, p->position.z, p->normal.x, p->normal.y, p->normal.z);
            }
    }
    for (const XrBaseInStructure *one = info->next; record && one; one = one->next)
        if ((int)one->type == TYPE_FRAME_END_INFO_ML)
            fprintf(record, "focus %.9g\n", ((const FrameEndInfoML *)(const void *)one)->focus_distance);
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL GetVisibilityMask(XrSession s, XrViewConfigurationType type, uint32_t i,
                                             XrVisibilityMaskTypeKHR kind,
                                             XrVisibilityMaskKHR *mask) {
    (void)s, (void)type, (void)kind;
    const XrFovf f = views[i].fov;
    const XrVector2f corners[4] = {{tanf(f.angleLeft), tanf(f.angleUp)},
                                   {tanf(f.angleRight), tanf(f.angleUp)},
                                   {tanf(f.angleRight), tanf(f.angleDown)},
                                   {tanf(f.angleLeft), tanf(f.angleDown)}};
    mask->vertexCountOutput = 4;
    mask->indexCountOutput = 0;
    if (mask->vertexCapacityInput >= 4) memcpy(mask->vertices, corners, sizeof corners);
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL CreateSwapchain(XrSession s, const XrSwapchainCreateInfo *info,
                                           XrSwapchain *to) {
    (void)s, (void)info;
    *to = NEW(XrSwapchain);
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL DestroySwapchain(XrSwapchain s) {
    (void)s;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL PollEvent(XrInstance i, XrEventDataBuffer *to) {
    (void)i;
    if (!is_ready) return XR_EVENT_UNAVAILABLE;
    is_ready = false;
    XrEventDataSessionStateChanged *event = (XrEventDataSessionStateChanged *)to;
    *event = (XrEventDataSessionStateChanged){XR_TYPE_EVENT_DATA_SESSION_STATE_CHANGED, NULL,
                                              (XrSession)(uintptr_t)last_handle,
                                              XR_SESSION_STATE_READY, 1};
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL GetInstanceProcAddr(XrInstance i, const char *name,
                                               PFN_xrVoidFunction *to) {
#define ENTRY(name)                                                                                \
    { "xr" #name, (PFN_xrVoidFunction)name }
    static const struct {
        const char *name;
        PFN_xrVoidFunction function;
    } all[] = {
        ENTRY(EnumerateInstanceExtensionProperties),
        ENTRY(CreateInstance),
        ENTRY(DestroyInstance),
        ENTRY(GetInstanceProperties),
        ENTRY(GetSystem),
        ENTRY(GetSystemProperties),
        ENTRY(CreateSession),
        ENTRY(DestroySession),
        ENTRY(BeginSession),
        ENTRY(EndSession),
        ENTRY(BeginFrame),
        ENTRY(WaitFrame),
        ENTRY(CreateReferenceSpace),
        ENTRY(DestroySpace),
        ENTRY(LocateSpace),
        ENTRY(LocateViews),
        ENTRY(EndFrame),
        ENTRY(CreateSwapchain),
        ENTRY(DestroySwapchain),
        ENTRY(PollEvent),
        ENTRY(GetInstanceProcAddr),
        {"xrGetVisibilityMaskKHR", (PFN_xrVoidFunction)GetVisibilityMask},
        {"xrEnumerateReprojectionModesMSFT", (PFN_xrVoidFunction)EnumerateReprojectionModes}};
    (void)i;
    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        if (!strcmp(name, all[k].name)) {
            *to = all[k].function;
            return XR_SUCCESS;
        }
    *to = NULL;
    return XR_ERROR_FUNCTION_UNSUPPORTED;
}

EXPORT XrResult XRAPI_CALL xrNegotiateLoaderRuntimeInterface(const LoaderInfo *loader,
                                                             RuntimeRequest *request) {
    (void)loader;
    request->interface_version = 1;
    request->api = XR_CURRENT_API_VERSION;
    request->get = GetInstanceProcAddr;
    return XR_SUCCESS;
}
