/* A headless OpenXR runtime for the tests: its head moves, its views are those in the environment,
 * and it writes down what it receives. With OpenGL its images are textures of the application's own
 * context, in the thread that calls.
 *   TEST_VIEWS     for each view x y z w, metres in VIEW space, and angles left right up down
 *   TEST_TURNED_S  from this display time on, the right views are 2 mm farther to the right
 *   TEST_SYSTEM    the headset's name
 *   TEST_EXTENSION one extension more
 *   TEST_RECORD    file for what xrEndFrame received
 *   TEST_CLOCK     1: frames come by the real clock, which is the monotonic one, 90 in a second
 *   TEST_HEAD      file with a struct Wearer, which moves the head and presses the button
 *   TEST_IMAGES    folder: while it holds a file `take`, the next images are written into it as
 *                  eye0 and eye1 (width, height, then RGBA from the lowest row), and it is removed
 *   TEST_SIZE_PX   width of the images (1268); their height is 720 / 1268 of it */
#define _GNU_SOURCE
#ifndef _WIN32
#define XR_USE_GRAPHICS_API_OPENGL
#define XR_USE_TIMESPEC
#include <time.h>
#endif
#include "../loader.h"

#include <locale.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifndef _WIN32
#include <dlfcn.h>
#include <fcntl.h>
#include <openxr/openxr_platform.h>
#include <sys/mman.h>
#include <unistd.h>
#endif

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

typedef struct {
    double pose[7]; /* of the head in LOCAL: x y z w, metres */
    int64_t is_pressed;
    int64_t t_ns; /* the time of both, which frames then have; 0: that of the clock */
} Wearer;
static const volatile Wearer *wearer; /* written by the test */
static Wearer worn;                   /* as it is in this frame */
static bool has_clock;
static XrTime changed; /* when the button was */

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
    if (wearer) {
        const double *n = worn.pose;
        return (XrPosef){{(float)n[0], (float)n[1], (float)n[2], (float)n[3]},
                         {(float)n[4], (float)n[5], (float)n[6]}};
    }
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
                           "XR_VARJO_quad_views",
#ifndef _WIN32
                           XR_KHR_OPENGL_ENABLE_EXTENSION_NAME,
                           XR_KHR_CONVERT_TIMESPEC_TIME_EXTENSION_NAME,
#endif
                           getenv("TEST_EXTENSION")};
    const uint32_t own = sizeof names / sizeof *names - 1;
    (void)layer;
    *count = names[own] ? own + 1 : own;
    if (capacity == 0) return XR_SUCCESS;
    if (capacity < *count) return XR_ERROR_SIZE_INSUFFICIENT;
    for (uint32_t i = 0; i < *count; i++) {
        snprintf(to[i].extensionName, sizeof to[i].extensionName, "%s", names[i]);
        to[i].extensionVersion = 1;
    }
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL CreateInstance(const XrInstanceCreateInfo *info, XrInstance *to) {
    XrExtensionProperties known[8];
    uint32_t count = 0;
    EnumerateInstanceExtensionProperties(NULL, 8, &count, known);
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
    has_clock = getenv("TEST_CLOCK") != NULL;
#ifndef _WIN32
    if (getenv("TEST_HEAD") && !wearer) {
        const int file = open(getenv("TEST_HEAD"), O_RDONLY);
        void *there = mmap(NULL, sizeof *wearer, PROT_READ, MAP_SHARED, file, 0);
        if (there == MAP_FAILED) return XR_ERROR_RUNTIME_FAILURE;
        wearer = there;
        worn = *wearer;
        close(file);
    }
#endif
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
#ifndef _WIN32
    if (has_clock) {
        struct timespec now;
        clock_gettime(CLOCK_MONOTONIC, &now);
        const XrTime now_ns = now.tv_sec * 1000000000 + now.tv_nsec, period_ns = 11111111;
        const XrTime next_ns = (now_ns / period_ns + 1) * period_ns;
        usleep((unsigned)((next_ns - now_ns) / 1000));
        to->predictedDisplayTime = next_ns + 2 * period_ns;
        if (wearer) {
            const Wearer before = worn;
            do worn = *wearer; /* again, if it is written meanwhile */
            while (worn.t_ns != wearer->t_ns);
            to->predictedDisplayTime = worn.t_ns > before.t_ns ? worn.t_ns : next_ns;
            if (worn.is_pressed != before.is_pressed) changed = to->predictedDisplayTime;
        }
        to->predictedDisplayPeriod = period_ns;
        to->shouldRender = XR_TRUE;
        return XR_SUCCESS;
    }
#endif
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

static void take_images(const XrCompositionLayerProjection *layer);

static XrResult XRAPI_CALL EndFrame(XrSession s, const XrFrameEndInfo *info) {
    (void)s;
    for (uint32_t k = 0; k < info->layerCount; k++) {
        const XrCompositionLayerProjection *layer =
            (const XrCompositionLayerProjection *)info->layers[k];
        if (layer->type != XR_TYPE_COMPOSITION_LAYER_PROJECTION) {
            if (record) fprintf(record, "other %d\n", layer->type);
            continue;
        }
        for (uint32_t i = 0; record && i < layer->viewCount; i++) {
            const XrView own = own_view(layer->space, info->displayTime, i);
            write_views(info->displayTime, i, own, layer->views[i].pose, layer->views[i].fov);
        }
        take_images(layer);
        for (const XrBaseInStructure *one = layer->next; record && one; one = one->next)
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

/* ---- images; in the application's context and thread ---- */

enum { IMAGES = 3, MOST_SWAPCHAINS = 8 };
static struct {
    XrSwapchain handle;
    uint32_t size[2], images[IMAGES], next, shown;
} swapchains[MOST_SWAPCHAINS];
static uint32_t swapchain_count;

static int swapchain_of(XrSwapchain handle) {
    for (uint32_t i = 0; i < swapchain_count; i++)
        if (swapchains[i].handle == handle) return (int)i;
    return -1;
}

static XrResult XRAPI_CALL EnumerateViewConfigurationViews(XrInstance i, XrSystemId id,
                                                           XrViewConfigurationType type,
                                                           uint32_t capacity, uint32_t *count,
                                                           XrViewConfigurationView *to) {
    (void)i, (void)id, (void)type;
    const char *text = getenv("TEST_SIZE_PX");
    const uint32_t width = text ? (uint32_t)atoi(text) : 1268, height = width * 720 / 1268;
    *count = 2;
    for (uint32_t k = 0; capacity >= 2 && k < 2; k++) {
        to[k].recommendedImageRectWidth = to[k].maxImageRectWidth = width;
        to[k].recommendedImageRectHeight = to[k].maxImageRectHeight = height;
        to[k].recommendedSwapchainSampleCount = to[k].maxSwapchainSampleCount = 1;
    }
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL EnumerateEnvironmentBlendModes(XrInstance i, XrSystemId id,
                                                          XrViewConfigurationType type,
                                                          uint32_t capacity, uint32_t *count,
                                                          XrEnvironmentBlendMode *to) {
    (void)i, (void)id, (void)type;
    *count = 1;
    if (capacity) to[0] = XR_ENVIRONMENT_BLEND_MODE_ADDITIVE;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL EnumerateSwapchainFormats(XrSession s, uint32_t capacity,
                                                     uint32_t *count, int64_t *to) {
    (void)s;
    *count = 1;
    if (capacity) to[0] = 0x8058; /* GL_RGBA8 */
    return XR_SUCCESS;
}

#ifdef _WIN32
static void make_textures(int i) { (void)i; }
static void take_images(const XrCompositionLayerProjection *layer) { (void)layer; }
#else
enum { TEXTURE_2D = 0x0DE1, RGBA8 = 0x8058, RGBA = 0x1908, UNSIGNED_BYTE = 0x1401 };

static void *gl(const char *name) {
    static void *library;
    if (!library) library = dlopen("libGL.so.1", RTLD_NOW);
    return library ? dlsym(library, name) : NULL;
}

static void make_textures(int i) {
    void (*gen)(int, uint32_t *) = (void (*)(int, uint32_t *))gl("glGenTextures");
    void (*bind)(unsigned, uint32_t) = (void (*)(unsigned, uint32_t))gl("glBindTexture");
    void (*image)(unsigned, int, int, int, int, int, unsigned, unsigned, const void *) =
        (void (*)(unsigned, int, int, int, int, int, unsigned, unsigned, const void *))gl(
            "glTexImage2D");
    if (!gen || !bind || !image) return;
    gen(IMAGES, swapchains[i].images);
    for (int k = 0; k < IMAGES; k++) {
        bind(TEXTURE_2D, swapchains[i].images[k]);
        image(TEXTURE_2D, 0, RGBA8, (int)swapchains[i].size[0], (int)swapchains[i].size[1], 0, RGBA,
              UNSIGNED_BYTE, NULL);
    }
}

static void take_images(const XrCompositionLayerProjection *layer) {
    const char *folder = getenv("TEST_IMAGES");
    char path[1000];
    if (!folder || snprintf(path, sizeof path, "%s/take", folder) < 0 || access(path, F_OK)) return;
    void (*bind)(unsigned, uint32_t) = (void (*)(unsigned, uint32_t))gl("glBindTexture");
    void (*get)(unsigned, int, unsigned, unsigned, void *) =
        (void (*)(unsigned, int, unsigned, unsigned, void *))gl("glGetTexImage");
    for (uint32_t view = 0; view < layer->viewCount; view++) {
        const int i = swapchain_of(layer->views[view].subImage.swapchain);
        if (i < 0) return;
        const size_t length = 4ul * swapchains[i].size[0] * swapchains[i].size[1];
        void *pixels = malloc(length);
        bind(TEXTURE_2D, swapchains[i].images[swapchains[i].shown]);
        get(TEXTURE_2D, 0, RGBA, UNSIGNED_BYTE, pixels);
        snprintf(path, sizeof path, "%s/eye%u", folder, view);
        FILE *file = fopen(path, "wb");
        fwrite(swapchains[i].size, sizeof swapchains[i].size, 1, file);
        fwrite(pixels, length, 1, file);
        fclose(file);
        free(pixels);
    }
    snprintf(path, sizeof path, "%s/take", folder);
    unlink(path);
}

static XrResult XRAPI_CALL GetOpenGLGraphicsRequirements(XrInstance i, XrSystemId id,
                                                         XrGraphicsRequirementsOpenGLKHR *to) {
    (void)i, (void)id;
    to->minApiVersionSupported = XR_MAKE_VERSION(1, 0, 0);
    to->maxApiVersionSupported = XR_MAKE_VERSION(9, 9, 0);
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL ConvertTimeToTimespecTime(XrInstance i, XrTime time,
                                                     struct timespec *to) {
    (void)i;
    to->tv_sec = time / 1000000000;
    to->tv_nsec = time % 1000000000;
    return XR_SUCCESS;
}

static XrResult XRAPI_CALL EnumerateSwapchainImages(XrSwapchain handle, uint32_t capacity,
                                                    uint32_t *count,
                                                    XrSwapchainImageBaseHeader *to) {
    const int i = swapchain_of(handle);
    if (i < 0) return XR_ERROR_HANDLE_INVALID;
    *count = IMAGES;
    for (uint32_t k = 0; capacity >= IMAGES && k < IMAGES; k++)
        ((XrSwapchainImageOpenGLKHR *)to)[k].image = swapchains[i].images[k];
    return XR_SUCCESS;
}
#endif

static XrResult XRAPI_CALL CreateSwapchain(XrSession s, const XrSwapchainCreateInfo *info,
                                           XrSwapchain *to) {
    (void)s;
    *to = NEW(XrSwapchain);
    if (info->format == 0x8058 && swapchain_count < MOST_SWAPCHAINS) {
        const int i = (int)swapchain_count++;
        swapchains[i].handle = *to;
        swapchains[i].size[0] = info->width, swapchains[i].size[1] = info->height;
        make_textures(i);
    }
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL DestroySwapchain(XrSwapchain s) {
    (void)s;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL AcquireSwapchainImage(XrSwapchain handle,
                                                 const XrSwapchainImageAcquireInfo *info,
                                                 uint32_t *index) {
    const int i = swapchain_of(handle);
    (void)info;
    if (i < 0) return XR_ERROR_HANDLE_INVALID;
    *index = swapchains[i].next = (swapchains[i].next + 1) % IMAGES;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL WaitSwapchainImage(XrSwapchain handle,
                                              const XrSwapchainImageWaitInfo *info) {
    (void)handle, (void)info;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL ReleaseSwapchainImage(XrSwapchain handle,
                                                 const XrSwapchainImageReleaseInfo *info) {
    const int i = swapchain_of(handle);
    (void)info;
    if (i < 0) return XR_ERROR_HANDLE_INVALID;
    swapchains[i].shown = swapchains[i].next;
    return XR_SUCCESS;
}

/* ---- one button ---- */

static XrResult XRAPI_CALL StringToPath(XrInstance i, const char *text, XrPath *to) {
    (void)i, (void)text;
    *to = ++last_handle;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL CreateActionSet(XrInstance i, const XrActionSetCreateInfo *info,
                                           XrActionSet *to) {
    (void)i, (void)info;
    *to = NEW(XrActionSet);
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL CreateAction(XrActionSet set, const XrActionCreateInfo *info,
                                        XrAction *to) {
    (void)set, (void)info;
    *to = NEW(XrAction);
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL
SuggestInteractionProfileBindings(XrInstance i, const XrInteractionProfileSuggestedBinding *to) {
    (void)i, (void)to;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL AttachSessionActionSets(XrSession s,
                                                   const XrSessionActionSetsAttachInfo *info) {
    (void)s, (void)info;
    return XR_SUCCESS;
}

static int64_t was_pressed, is_pressed;

static XrResult XRAPI_CALL SyncActions(XrSession s, const XrActionsSyncInfo *info) {
    (void)s, (void)info;
    was_pressed = is_pressed;
    is_pressed = worn.is_pressed;
    return XR_SUCCESS;
}
static XrResult XRAPI_CALL GetActionStateBoolean(XrSession s, const XrActionStateGetInfo *info,
                                                 XrActionStateBoolean *to) {
    (void)s, (void)info;
    to->isActive = XR_TRUE;
    to->currentState = is_pressed != 0;
    to->changedSinceLastSync = is_pressed != was_pressed;
    to->lastChangeTime = changed;
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
        ENTRY(AcquireSwapchainImage),
        ENTRY(WaitSwapchainImage),
        ENTRY(ReleaseSwapchainImage),
        ENTRY(EnumerateViewConfigurationViews),
        ENTRY(EnumerateEnvironmentBlendModes),
        ENTRY(EnumerateSwapchainFormats),
        ENTRY(StringToPath),
        ENTRY(CreateActionSet),
        ENTRY(CreateAction),
        ENTRY(SuggestInteractionProfileBindings),
        ENTRY(AttachSessionActionSets),
        ENTRY(SyncActions),
        ENTRY(GetActionStateBoolean),
#ifndef _WIN32
        ENTRY(EnumerateSwapchainImages),
        {"xrGetOpenGLGraphicsRequirementsKHR", (PFN_xrVoidFunction)GetOpenGLGraphicsRequirements},
        {"xrConvertTimeToTimespecTimeKHR", (PFN_xrVoidFunction)ConvertTimeToTimespecTime},
#endif
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
