/* An OpenXR application for the tests, which knows nothing of handcal: it locates its views, writes
 * them down, and submits them. Arguments are NAME=VALUE:
 *   loader    library of the loader
 *   frames    number of frames (1)
 *   count     of views, 2 or 4
 *   sessions  1 or 2, each in threads of its own (1)
 *   submit    same, crop (the inner half of each view) or turn (views turned by the application)
 *   bench     calls of xrLocateViews and xrEndFrame to time, best of 7
 *   locale    locale of the application
 *   pause_ms  after each frame
 *   mask      1: write the visibility masks down
 *   owner     announce this owner of the correction to the library of the layer
 *   layer     that library
 *   api       minor version of OpenXR that is asked for (0)
 *   extension one extension more
 *   wrong     1: pass a structure of a wrong type, which a validation must report */
#define _GNU_SOURCE
#include <locale.h>
#include <math.h>
#include <openxr/openxr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef _WIN32
#include <windows.h>
#define load(name) (void *)LoadLibraryA(name)
#define symbol(library, name) (void *)GetProcAddress((HMODULE)(library), name)
#define pause_ms(ms) Sleep(ms)
#else
#include <dlfcn.h>
#include <pthread.h>
#include <unistd.h>
#define load(name) dlopen(name, RTLD_NOW)
#define symbol(library, name) dlsym(library, name)
#define pause_ms(ms) usleep(1000 * (ms))
#endif

static int argc_;
static char **argv_;

static const char *option(const char *name, const char *otherwise) {
    const size_t length = strlen(name);
    for (int i = 1; i < argc_; i++)
        if (!strncmp(argv_[i], name, length) && argv_[i][length] == '=')
            return argv_[i] + length + 1;
    return otherwise;
}

static XrInstance instance;
static PFN_xrGetInstanceProcAddr get;

static PFN_xrVoidFunction function(const char *name) {
    PFN_xrVoidFunction found = NULL;
    if (XR_FAILED(get(instance, name, &found))) {
        fprintf(stderr, "no %s\n", name);
        exit(1);
    }
    return found;
}
#define CALL(name, ...)                                                                            \
    do {                                                                                           \
        const XrResult r_ = ((PFN_xr##name)function("xr" #name))(__VA_ARGS__);                     \
        if (XR_FAILED(r_)) {                                                                       \
            fprintf(stderr, "xr" #name " failed: %d\n", r_);                                       \
            exit(1);                                                                               \
        }                                                                                          \
    } while (0)

static void write_view(int session, XrTime time, uint32_t i, XrPosef p, XrFovf f) {
    printf("view %d %.9f %u %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", session,
           1e-9 * (double)time, i, p.orientation.x, p.orientation.y, p.orientation.z,
           p.orientation.w, p.position.x, p.position.y, p.position.z, f.angleLeft, f.angleRight,
           f.angleUp, f.angleDown);
}

static double cpu_us(void) {
#ifdef _WIN32
    return 1e6 * clock() / CLOCKS_PER_SEC;
#else
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
#endif
}

static void *run(void *number) {
    const int which = *(int *)number, frames = atoi(option("frames", "1")),
              wait = atoi(option("pause_ms", "0"));
    const int bench = atoi(option("bench", "0"));
    const uint32_t count = (uint32_t)atoi(option("count", "2"));
    const char *submit = option("submit", "same");
    const XrViewConfigurationType type = count == 4 ? XR_VIEW_CONFIGURATION_TYPE_PRIMARY_QUAD_VARJO
                                                    : XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO;
    XrSessionCreateInfo create = {XR_TYPE_SESSION_CREATE_INFO, NULL, 0, 1};
    XrSession session;
    CALL(CreateSession, instance, &create, &session);
    XrReferenceSpaceCreateInfo reference = {XR_TYPE_REFERENCE_SPACE_CREATE_INFO,
                                            NULL,
                                            XR_REFERENCE_SPACE_TYPE_LOCAL,
                                            {{0, 0, 0, 1}, {0, 0, 0}}};
    XrSpace local, head;
    CALL(CreateReferenceSpace, session, &reference, &local);
    reference.referenceSpaceType = XR_REFERENCE_SPACE_TYPE_VIEW;
    CALL(CreateReferenceSpace, session, &reference, &head);
    XrEventDataBuffer event = {.type = XR_TYPE_EVENT_DATA_BUFFER};
    CALL(PollEvent, instance, &event);
    XrSessionBeginInfo begin = {XR_TYPE_SESSION_BEGIN_INFO, NULL, type};
    CALL(BeginSession, session, &begin);
    XrSwapchainCreateInfo images = {XR_TYPE_SWAPCHAIN_CREATE_INFO,
                                    NULL,
                                    0,
                                    XR_SWAPCHAIN_USAGE_COLOR_ATTACHMENT_BIT,
                                    1,
                                    1,
                                    64,
                                    64,
                                    1,
                                    1,
                                    1};
    XrSwapchain swapchain;
    CALL(CreateSwapchain, session, &images, &swapchain);
    const PFN_xrLocateViews locate_views = (PFN_xrLocateViews)function("xrLocateViews");
    const PFN_xrEndFrame end_frame = (PFN_xrEndFrame)function("xrEndFrame");
    double best_us[2] = {1e9, 1e9};
    for (int frame = 0; frame < frames; frame++) {
        XrFrameState state = {.type = XR_TYPE_FRAME_STATE};
        CALL(WaitFrame, session, NULL, &state);
        CALL(BeginFrame, session, NULL);
        XrViewLocateInfo where = {XR_TYPE_VIEW_LOCATE_INFO, NULL, type, state.predictedDisplayTime,
                                  local};
        if (atoi(option("wrong", "0"))) where.type = XR_TYPE_VIEW;
        XrViewState valid = {.type = XR_TYPE_VIEW_STATE};
        XrView views[4] = {{.type = XR_TYPE_VIEW},
                           {.type = XR_TYPE_VIEW},
                           {.type = XR_TYPE_VIEW},
                           {.type = XR_TYPE_VIEW}};
        uint32_t located = 0;
        if (XR_FAILED(locate_views(session, &where, &valid, count, &located, views))) exit(3);
        XrSpaceLocation there = {.type = XR_TYPE_SPACE_LOCATION};
        CALL(LocateSpace, head, local, state.predictedDisplayTime, &there);
        XrCompositionLayerProjectionView parts[4];
        for (uint32_t i = 0; i < count; i++) {
            write_view(which, state.predictedDisplayTime, i, views[i].pose, views[i].fov);
            XrFovf fov = views[i].fov;
            XrPosef pose = views[i].pose;
            if (!strcmp(submit, "crop")) { /* the inner half of each view */
                const float x[2] = {tanf(fov.angleLeft), tanf(fov.angleRight)},
                            y[2] = {tanf(fov.angleUp), tanf(fov.angleDown)};
                fov = (XrFovf){
                    atanf(0.75f * x[0] + 0.25f * x[1]), atanf(0.25f * x[0] + 0.75f * x[1]),
                    atanf(0.75f * y[0] + 0.25f * y[1]), atanf(0.25f * y[0] + 0.75f * y[1])};
            }
            if (!strcmp(submit, "turn")) pose.position.y += 0.1f;
            parts[i] = (XrCompositionLayerProjectionView){XR_TYPE_COMPOSITION_LAYER_PROJECTION_VIEW,
                                                          NULL,
                                                          pose,
                                                          fov,
                                                          {swapchain, {{0, 0}, {64, 64}}, 0}};
        }
        printf("head %d %.9f %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", which,
               1e-9 * (double)state.predictedDisplayTime, there.pose.orientation.x,
               there.pose.orientation.y, there.pose.orientation.z, there.pose.orientation.w,
               there.pose.position.x, there.pose.position.y, there.pose.position.z);
        XrCompositionLayerProjection layer = {
            XR_TYPE_COMPOSITION_LAYER_PROJECTION, NULL, 0, local, count, parts};
        const XrCompositionLayerBaseHeader *layers[] = {
            (const XrCompositionLayerBaseHeader *)&layer};
        XrFrameEndInfo end = {XR_TYPE_FRAME_END_INFO,           NULL, state.predictedDisplayTime,
                              XR_ENVIRONMENT_BLEND_MODE_OPAQUE, 1,    layers};
        if (XR_FAILED(end_frame(session, &end))) exit(4);
        for (int of = 0; bench && of < 7; of++) {
            const double a = cpu_us();
            for (int i = 0; i < bench; i++)
                where.displayTime += 1000,
                    locate_views(session, &where, &valid, count, &located, views);
            for (uint32_t i = 0; i < count; i++)
                parts[i].pose = views[i].pose, parts[i].fov = views[i].fov;
            const double b = cpu_us();
            for (int i = 0; i < bench; i++) end_frame(session, &end);
            const double c = cpu_us();
            if ((b - a) / bench < best_us[0]) best_us[0] = (b - a) / bench;
            if ((c - b) / bench < best_us[1]) best_us[1] = (c - b) / bench;
        }
        if (wait) fflush(stdout), pause_ms(wait);
    }
    if (bench) printf("bench %.4f %.4f\n", best_us[0], best_us[1]);
    for (uint32_t i = 0; atoi(option("mask", "0")) && i < count; i++) {
        XrVector2f corners[4];
        uint32_t none[4];
        XrVisibilityMaskKHR mask = {XR_TYPE_VISIBILITY_MASK_KHR, NULL, 4, 0, corners, 4, 0, none};
        CALL(GetVisibilityMaskKHR, session, type, i, XR_VISIBILITY_MASK_TYPE_LINE_LOOP_KHR, &mask);
        printf("mask %u", i);
        for (uint32_t k = 0; k < mask.vertexCountOutput; k++)
            printf(" %.9g %.9g", corners[k].x, corners[k].y);
        printf("\n");
    }
    CALL(DestroySession, session);
    return NULL;
}

int main(int argc, char **argv) {
    argc_ = argc, argv_ = argv;
    if (*option("locale", "") && !setlocale(LC_ALL, option("locale", ""))) return 5;
    void *loader = load(option("loader", "libopenxr_loader.so.1"));
    if (!loader) {
        fprintf(stderr, "no loader\n");
        return 1;
    }
    get = (PFN_xrGetInstanceProcAddr)symbol(loader, "xrGetInstanceProcAddr");
    const char *extensions[] = {"XR_MND_headless", XR_KHR_VISIBILITY_MASK_EXTENSION_NAME,
                                "XR_VARJO_quad_views",
                                option("extension", "")};
    const uint64_t minor = (uint64_t)atoi(option("api", "0"));
    XrInstanceCreateInfo info = {XR_TYPE_INSTANCE_CREATE_INFO,
                                 NULL,
                                 0,
                                 {"test application", 1, "", 1, XR_MAKE_VERSION(1, minor, 0)},
                                 0,
                                 NULL,
                                 *option("extension", "") ? 4 : 3,
                                 extensions};
    CALL(CreateInstance, &info, &instance);
    XrSystemGetInfo form = {XR_TYPE_SYSTEM_GET_INFO, NULL, XR_FORM_FACTOR_HEAD_MOUNTED_DISPLAY};
    XrSystemId system;
    CALL(GetSystem, instance, &form, &system);
    if (*option("owner", "")) {
        void *layer = load(option("layer", ""));
        void (*own)(const char *) =
            layer ? (void (*)(const char *))symbol(layer, "handcal_correction_owner") : NULL;
        if (!own) return 6;
        own(option("owner", ""));
    }
    int numbers[2] = {0, 1};
#ifdef _WIN32
    run(&numbers[0]);
#else
    const int sessions = atoi(option("sessions", "1"));
    pthread_t threads[2];
    for (int i = 0; i < sessions; i++) pthread_create(&threads[i], NULL, run, &numbers[i]);
    for (int i = 0; i < sessions; i++) pthread_join(threads[i], NULL);
#endif
    CALL(DestroyInstance, instance);
    return 0;
}
