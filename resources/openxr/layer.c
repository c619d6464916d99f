/* An OpenXR API layer between every application and the runtime of this computer, by which each
 * renders with the calibrated views of views.h, and the runtime receives its own. The calibration
 * is openxr.json in handcal's configuration folder. A thread reads it once a second, and writes
 * into openxr-status.json what became of it: a frame waits for no file, only for copies under one
 * lock. */
#define _GNU_SOURCE
#include "loader.h"
#include "views.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#define EXPORT __declspec(dllexport)
typedef SRWLOCK Lock;
#define LOCK_INIT SRWLOCK_INIT
#define lock(it) AcquireSRWLockExclusive(it)
#define unlock(it) ReleaseSRWLockExclusive(it)
typedef wchar_t Char;
#define TEXT_(text) L##text
#define join_path(to, size, folder, file) _snwprintf(to, size, L"%ls\\%ls", folder, file)
#define open_file _wfopen
#else
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>
#define EXPORT __attribute__((visibility("default")))
typedef pthread_mutex_t Lock;
#define LOCK_INIT PTHREAD_MUTEX_INITIALIZER
#define lock(it) pthread_mutex_lock(it)
#define unlock(it) pthread_mutex_unlock(it)
typedef char Char;
#define TEXT_(text) text
#define join_path(to, size, folder, file) snprintf(to, size, "%s/%s", folder, file)
#define open_file fopen
#endif

#define NAME "XR_APILAYER_HANDCAL_calibrated_views"
#define COUNT(array) (sizeof(array) / sizeof *(array))

static const char *const EXTENSIONS[] = {XR_MSFT_COMPOSITION_LAYER_REPROJECTION_EXTENSION_NAME,
                                         "XR_ML_frame_end_info"};

/* ---- what is known of each instance and session ---- */

typedef struct Instance {
    struct Instance *next;
    XrInstance handle;
    bool has_plane, has_focus; /* the extension is enabled */
    char application[XR_MAX_APPLICATION_NAME_SIZE], runtime[XR_MAX_RUNTIME_NAME_SIZE];
    PFN_xrGetInstanceProcAddr get;
    PFN_xrDestroyInstance destroy_instance;
    PFN_xrCreateSession create_session;
    PFN_xrDestroySession destroy_session;
    PFN_xrLocateViews locate_views;
    PFN_xrEndFrame end_frame;
    PFN_xrGetVisibilityMaskKHR get_mask;
} Instance;

typedef struct Session {
    struct Session *next;
    XrSession handle;
    Instance *instance;
    XrSpace head;
    bool takes_plane; /* the runtime reprojects by a plane that is given */
    bool is_other_system;
    char system[XR_MAX_SYSTEM_NAME_SIZE];
    HandcalViews views;
} Session;

static struct {
    Lock lock;
    Instance *instances;
    Session *sessions;
    HandcalCalibration calibration;
    bool is_usable;      /* the calibration is in force */
    const char *problem; /* why not */
    char owner[64];      /* who corrects in its stead; empty: nobody */
} g = {.lock = LOCK_INIT};

static Instance *find_instance(XrInstance handle) {
    Instance *one = g.instances;
    while (one && one->handle != handle) one = one->next;
    return one;
}

static Session *find_session(XrSession handle) {
    Session *one = g.sessions;
    while (one && one->handle != handle) one = one->next;
    return one;
}

/* ---- files ---- */

static Lock files = LOCK_INIT; /* held by the one that reads or writes */

/* A path in the folder of `configuration_folder` (handcal/io/configuration.py); false: there is
 * none. */
static bool path_of(const Char *file, Char *to, size_t size) {
    Char folder[1024];
#ifdef _WIN32
    const wchar_t *local = _wgetenv(L"LOCALAPPDATA"), *home = _wgetenv(L"USERPROFILE");
    if (!(local && *local) && !home) return false;
    const int length = local && *local
                           ? _snwprintf(folder, 1000, L"%ls\\handcal", local)
                           : _snwprintf(folder, 1000, L"%ls\\AppData\\Local\\handcal", home);
#else
    const char *configuration = getenv("XDG_CONFIG_HOME"), *home = getenv("HOME");
    if (!(configuration && *configuration) && !home) return false;
    const int length = configuration && *configuration
                           ? snprintf(folder, 1000, "%s/handcal", configuration)
                           : snprintf(folder, 1000, "%s/.config/handcal", home);
#endif
    if (length < 0 || length >= 1000) return false;
    const int whole = join_path(to, size, folder, file);
    return whole > 0 && (size_t)whole < size;
}

/* At most `size` bytes; -1: there is no such file. A device or pipe in its place is not opened. */
static long read_file(const Char *path, char *to, size_t size) {
#ifndef _WIN32
    struct stat kind;
    if (stat(path, &kind) || !S_ISREG(kind.st_mode)) return -1;
#endif
    FILE *file = open_file(path, TEXT_("rb"));
    if (!file) return -1;
    const size_t length = fread(to, 1, size, file);
    fclose(file);
    return (long)length;
}

static void write_file(const Char *path, const char *text) {
    Char other[1200];
#ifdef _WIN32
    if (_snwprintf(other, COUNT(other) - 1, L"%ls.%lu", path, GetCurrentProcessId()) < 0) return;
#else
    if (snprintf(other, sizeof other, "%s.%ld", path, (long)getpid()) >= (int)sizeof other) return;
#endif
    FILE *file = open_file(other, TEXT_("wb"));
    if (!file) return;
    const bool is_whole = fputs(text, file) >= 0;
#ifdef _WIN32
    if (fclose(file) || !is_whole || !MoveFileExW(other, path, MOVEFILE_REPLACE_EXISTING))
        _wremove(other);
#else
    if (fclose(file) || !is_whole || rename(other, path)) remove(other);
#endif
}

static void read_calibration(void) {
    static char text[HANDCAL_LONGEST + 1];
    static HandcalCalibration found;
    Char path[1100];
    const char *problem = "no calibration is in force";
    lock(&files);
    const long length =
        path_of(TEXT_("openxr.json"), path, COUNT(path)) ? read_file(path, text, sizeof text) : -1;
    if (length >= 0) problem = handcal_read(text, (size_t)length, &found);
    if (!problem && found.expires_unix_s > 0.0 && (double)time(NULL) >= found.expires_unix_s)
        problem = "the calibration has expired";
    lock(&g.lock);
    g.problem = problem;
    g.is_usable = !problem;
    if (!problem) g.calibration = found;
    unlock(&g.lock);
    unlock(&files);
}

/* Names of others, as a string of JSON. */
static void plain(char *text) {
    for (; *text; text++)
        if (*text < 32 || *text > 126 || *text == '"' || *text == '\\') *text = '?';
}

static const char *const REFUSALS[] = {
    [HANDCAL_OTHER_DISTANCE] =
        "the right view lies %.1f mm from where the rig has it, seen from the left: set the "
        "headset's eye distance as it was at the calibration, or calibrate with this headset's rig",
    [HANDCAL_OTHER_DIRECTION] =
        "the views are turned against each other by %.1f mrad, compared with the rig: calibrate "
        "with this headset's rig",
    [HANDCAL_OTHER_FIELD] =
        "an edge of the view lies %.1f / 1000 of the distance from where the rig has it: calibrate "
        "with this headset's rig",
    [HANDCAL_OTHER_VIEWS] =
        "the inner views look from other places than the outer ones, which cannot be corrected"};

/* Writes what became of the calibration, if that has changed. */
static void write_status(void) {
    static char before[2048];
    char text[2048], reason[512] = "";
    const char *state = "waiting";
    Char path[1100];
    lock(&g.lock);
    const Session *session = g.sessions;
    for (const Session *one = session; one; one = one->next)
        if (one->is_other_system || one->views.state > HANDCAL_OFF)
            session = one; /* a refusal first */
    if (!session) { /* what the last one came to stays */
        unlock(&g.lock);
        return;
    }
    if (g.owner[0]) {
        state = "refused";
        snprintf(reason, sizeof reason, "%s corrects already", g.owner);
    } else if (g.problem) {
        state = "off";
        snprintf(reason, sizeof reason, "%s", g.problem);
    } else if (session->is_other_system) {
        state = "refused";
        snprintf(reason, sizeof reason, "the calibration is for the headset %s",
                 g.calibration.system);
        plain(reason);
    } else if (session->views.state == HANDCAL_ACTIVE) {
        state = "active";
    } else if (session->views.state > HANDCAL_OFF) {
        state = "refused";
        snprintf(reason, sizeof reason, REFUSALS[session->views.state], session->views.measured);
    }
    char application[XR_MAX_APPLICATION_NAME_SIZE], runtime[XR_MAX_RUNTIME_NAME_SIZE],
        system[XR_MAX_SYSTEM_NAME_SIZE];
    strcpy(application, session->instance->application);
    strcpy(runtime, session->instance->runtime);
    strcpy(system, session->system);
    unlock(&g.lock);
    plain(application), plain(runtime), plain(system);
    snprintf(text, sizeof text,
             "{\"handcalOpenxrStatus\": 1, \"state\": \"%s\", \"reason\": \"%s\", "
             "\"application\": \"%s\", \"runtime\": \"%s\", \"system\": \"%s\"}\n",
             state, reason, application, runtime, system);
    lock(&files);
    if (strcmp(text, before) && path_of(TEXT_("openxr-status.json"), path, COUNT(path))) {
        strcpy(before, text);
        write_file(path, text);
    }
    unlock(&files);
}

/* ---- the thread, from the first instance to the end of the last ---- */

static Lock life = LOCK_INIT; /* held while it is started or ended */

#ifdef _WIN32
static HANDLE thread, stop;

static DWORD WINAPI watch(void *unused) {
    (void)unused;
    while (WaitForSingleObject(stop, 1000) == WAIT_TIMEOUT) read_calibration(), write_status();
    return 0;
}

static bool start(void) {
    stop = CreateEventW(NULL, TRUE, FALSE, NULL);
    thread = stop ? CreateThread(NULL, 0, watch, NULL, 0, NULL) : NULL;
    if (!thread && stop) CloseHandle(stop);
    return thread != NULL;
}

static void end(void) {
    SetEvent(stop);
    WaitForSingleObject(thread, INFINITE);
    CloseHandle(thread);
    CloseHandle(stop);
}
#else
static pthread_t thread;
static int stop;

static void *watch(void *unused) {
    struct pollfd event = {.fd = stop, .events = POLLIN};
    while (poll(&event, 1, 1000) <= 0) read_calibration(), write_status();
    return unused;
}

static bool start(void) {
    sigset_t all, before; /* the application's signals are for its own threads */
    stop = eventfd(0, EFD_CLOEXEC);
    if (stop < 0) return false;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const bool is_started = !pthread_create(&thread, NULL, watch, NULL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!is_started) close(stop);
    return is_started;
}

static void end(void) {
    eventfd_write(stop, 1);
    pthread_join(thread, NULL);
    close(stop);
}
#endif

/* ---- the functions that are hooked ---- */

static XrResult XRAPI_CALL DestroyInstance(XrInstance handle) {
    lock(&life);
    lock(&g.lock);
    Instance *instance = find_instance(handle);
    unlock(&g.lock);
    const XrResult result = instance ? instance->destroy_instance(handle) : XR_ERROR_HANDLE_INVALID;
    bool is_last = false;
    if (XR_SUCCEEDED(result)) {
        write_status(); /* of a program that was shorter than a second */
        lock(&g.lock);
        for (Session **at = &g.sessions; *at;) {
            Session *one = *at;
            if (one->instance != instance) {
                at = &one->next;
                continue;
            }
            *at = one->next;
            free(one);
        }
        Instance **at = &g.instances;
        while (*at != instance) at = &(*at)->next;
        *at = instance->next;
        is_last = !g.instances;
        unlock(&g.lock);
        free(instance);
    }
    if (is_last) end();
    unlock(&life);
    return result;
}

static XrResult XRAPI_CALL CreateSession(XrInstance handle, const XrSessionCreateInfo *info,
                                         XrSession *session) {
    lock(&g.lock);
    Instance *instance = find_instance(handle);
    unlock(&g.lock);
    if (!instance) return XR_ERROR_HANDLE_INVALID;
    Session *made = calloc(1, sizeof *made);
    if (!made) return XR_ERROR_OUT_OF_MEMORY;
    const XrResult result = instance->create_session(handle, info, session);
    if (XR_FAILED(result)) {
        free(made);
        return result;
    }
    PFN_xrCreateReferenceSpace create_space = NULL;
    PFN_xrGetSystemProperties get_system = NULL;
    PFN_xrEnumerateReprojectionModesMSFT get_modes = NULL;
    instance->get(handle, "xrCreateReferenceSpace", (PFN_xrVoidFunction *)&create_space);
    instance->get(handle, "xrGetSystemProperties", (PFN_xrVoidFunction *)&get_system);
    if (instance->has_plane)
        instance->get(handle, "xrEnumerateReprojectionModesMSFT", (PFN_xrVoidFunction *)&get_modes);
    XrReferenceSpaceCreateInfo head = {XR_TYPE_REFERENCE_SPACE_CREATE_INFO,
                                       NULL,
                                       XR_REFERENCE_SPACE_TYPE_VIEW,
                                       {{0, 0, 0, 1}, {0, 0, 0}}};
    if (!create_space || XR_FAILED(create_space(*session, &head, &made->head)))
        made->head = XR_NULL_HANDLE;
    XrSystemProperties system = {.type = XR_TYPE_SYSTEM_PROPERTIES};
    if (get_system && XR_SUCCEEDED(get_system(handle, info->systemId, &system)))
        snprintf(made->system, sizeof made->system, "%.*s", (int)sizeof made->system - 1,
                 system.systemName);
    XrReprojectionModeMSFT modes[8];
    uint32_t count = 0;
    if (get_modes &&
        XR_SUCCEEDED(get_modes(handle, info->systemId, XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO,
                               COUNT(modes), &count, modes)))
        for (uint32_t i = 0; i < count; i++)
            made->takes_plane |= modes[i] == XR_REPROJECTION_MODE_PLANAR_MANUAL_MSFT;
    made->handle = *session;
    made->instance = instance;
    lock(&g.lock);
    made->next = g.sessions;
    g.sessions = made;
    unlock(&g.lock);
    return result;
}

static XrResult XRAPI_CALL DestroySession(XrSession handle) {
    lock(&g.lock);
    Session *session = find_session(handle);
    unlock(&g.lock);
    if (!session) return XR_ERROR_HANDLE_INVALID;
    write_status();
    const XrResult result = session->instance->destroy_session(handle);
    if (XR_FAILED(result)) return result;
    lock(&g.lock);
    Session **at = &g.sessions;
    while (*at && *at != session) at = &(*at)->next;
    if (*at) *at = session->next;
    unlock(&g.lock);
    free(session);
    return result;
}

static XrResult XRAPI_CALL LocateViews(XrSession handle, const XrViewLocateInfo *info,
                                       XrViewState *state, uint32_t capacity, uint32_t *count,
                                       XrView *views) {
    lock(&g.lock);
    Session *session = find_session(handle);
    const bool needs_head = g.is_usable && g.calibration.moving_eyes;
    unlock(&g.lock);
    if (!session) return XR_ERROR_HANDLE_INVALID;
    const PFN_xrLocateViews locate = session->instance->locate_views;
    const XrResult result = locate(handle, info, state, capacity, count, views);
    if (XR_FAILED(result)) return result; /* perhaps for want of a structure */
    const bool is_two =
        info->viewConfigurationType == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO && *count == 2;
    const bool is_four =
        info->viewConfigurationType == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_QUAD_VARJO && *count == 4;
    if (!views || capacity < *count || !(is_two || is_four)) return result;
    XrView in_head[HANDCAL_VIEWS];
    bool has_head = false;
    if (needs_head && session->head != XR_NULL_HANDLE) {
        const XrViewStateFlags whole =
            XR_VIEW_STATE_ORIENTATION_VALID_BIT | XR_VIEW_STATE_POSITION_VALID_BIT;
        XrViewLocateInfo there = {XR_TYPE_VIEW_LOCATE_INFO, NULL, info->viewConfigurationType,
                                  info->displayTime, session->head};
        XrViewState found = {.type = XR_TYPE_VIEW_STATE};
        uint32_t number = 0;
        for (int i = 0; i < HANDCAL_VIEWS; i++) in_head[i] = (XrView){.type = XR_TYPE_VIEW};
        has_head = XR_SUCCEEDED(locate(handle, &there, &found, HANDCAL_VIEWS, &number, in_head)) &&
                   number == *count && (found.viewStateFlags & whole) == whole;
    }
    lock(&g.lock);
    session->is_other_system =
        g.is_usable && g.calibration.system[0] && strcmp(g.calibration.system, session->system);
    const bool is_used = g.is_usable && !g.owner[0] && !session->is_other_system;
    handcal_locate(&session->views, is_used ? &g.calibration : NULL, state->viewStateFlags,
                   has_head ? in_head : NULL, *count, views);
    unlock(&g.lock);
    return result;
}

static bool has_type(const void *chain, int type) {
    for (const XrBaseInStructure *one = chain; one; one = one->next)
        if ((int)one->type == type) return true;
    return false;
}

enum { MOST_LAYERS = 128, MOST_PROJECTIONS = 16 };

static XrResult XRAPI_CALL EndFrame(XrSession handle, const XrFrameEndInfo *info) {
    const XrCompositionLayerBaseHeader *layers[MOST_LAYERS];
    XrCompositionLayerProjection projections[MOST_PROJECTIONS];
    XrCompositionLayerProjectionView views[MOST_PROJECTIONS][HANDCAL_VIEWS];
    XrCompositionLayerReprojectionInfoMSFT modes[MOST_PROJECTIONS];
    XrCompositionLayerReprojectionPlaneOverrideMSFT planes[MOST_PROJECTIONS];
    int used = 0;
    if (!info || info->layerCount > MOST_LAYERS || (info->layerCount && !info->layers))
        return info && info->layerCount > MOST_LAYERS ? XR_ERROR_LAYER_LIMIT_EXCEEDED
                                                      : XR_ERROR_VALIDATION_FAILURE;
    lock(&g.lock);
    Session *session = find_session(handle);
    if (!session) {
        unlock(&g.lock);
        return XR_ERROR_HANDLE_INVALID;
    }
    const float image_m =
        session->views.state == HANDCAL_ACTIVE ? (float)g.calibration.image_m : 0.0f;
    for (uint32_t k = 0; k < info->layerCount; k++) {
        layers[k] = info->layers[k];
        if (!layers[k] || layers[k]->type != XR_TYPE_COMPOSITION_LAYER_PROJECTION) continue;
        const XrCompositionLayerProjection *in = (const XrCompositionLayerProjection *)layers[k];
        if (!in->views || (in->viewCount != 2 && in->viewCount != 4)) continue;
        if (used == MOST_PROJECTIONS) {
            unlock(&g.lock);
            return XR_ERROR_LAYER_LIMIT_EXCEEDED;
        }
        XrCompositionLayerProjection *out = &projections[used];
        *out = *in;
        out->views = views[used];
        for (uint32_t i = 0; i < in->viewCount; i++) {
            views[used][i] = in->views[i]; /* with its chain: depth stays where it is */
            handcal_submit(&session->views, i, &views[used][i].pose, &views[used][i].fov);
        }
        if (session->takes_plane && image_m > 0.0f &&
            !has_type(in->next, XR_TYPE_COMPOSITION_LAYER_REPROJECTION_INFO_MSFT) &&
            !has_type(in->next, XR_TYPE_COMPOSITION_LAYER_REPROJECTION_PLANE_OVERRIDE_MSFT)) {
            const XrQuaternionf q = views[used][0].pose.orientation;
            const XrVector3f a = views[used][0].pose.position, b = views[used][1].pose.position;
            const XrVector3f back = {2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
                                     1 - 2 * (q.x * q.x + q.y * q.y)};
            const XrVector3f at = {(a.x + b.x) / 2 - image_m * back.x,
                                   (a.y + b.y) / 2 - image_m * back.y,
                                   (a.z + b.z) / 2 - image_m * back.z};
            planes[used] = (XrCompositionLayerReprojectionPlaneOverrideMSFT){
                XR_TYPE_COMPOSITION_LAYER_REPROJECTION_PLANE_OVERRIDE_MSFT,
                in->next,
                at,
                back,
                {0, 0, 0}};
            modes[used] = (XrCompositionLayerReprojectionInfoMSFT){
                XR_TYPE_COMPOSITION_LAYER_REPROJECTION_INFO_MSFT, &planes[used],
                XR_REPROJECTION_MODE_PLANAR_MANUAL_MSFT};
            out->next = &modes[used];
        }
        layers[k] = (const XrCompositionLayerBaseHeader *)out;
        used++;
    }
    unlock(&g.lock);
    XrFrameEndInfo out = *info;
    if (info->layerCount) out.layers = layers;
    FrameEndInfoML focus = {(XrStructureType)TYPE_FRAME_END_INFO_ML, info->next, image_m, 0};
    if (used && image_m > 0.0f && session->instance->has_focus &&
        !has_type(info->next, TYPE_FRAME_END_INFO_ML))
        out.next = &focus;
    return session->instance->end_frame(handle, &out);
}

static XrResult XRAPI_CALL GetVisibilityMask(XrSession handle,
                                             XrViewConfigurationType configuration, uint32_t view,
                                             XrVisibilityMaskTypeKHR type,
                                             XrVisibilityMaskKHR *mask) {
    lock(&g.lock);
    Session *session = find_session(handle);
    unlock(&g.lock);
    if (!session) return XR_ERROR_HANDLE_INVALID;
    const XrResult result = session->instance->get_mask(handle, configuration, view, type, mask);
    const bool is_ours = configuration == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO ||
                         configuration == XR_VIEW_CONFIGURATION_TYPE_PRIMARY_QUAD_VARJO;
    if (XR_FAILED(result) || !is_ours || view >= HANDCAL_VIEWS || !mask->vertices ||
        mask->vertexCapacityInput < mask->vertexCountOutput)
        return result;
    lock(&g.lock);
    handcal_mask(&session->views, g.is_usable && !g.owner[0] ? &g.calibration : NULL, view,
                 mask->vertexCountOutput, mask->vertices);
    unlock(&g.lock);
    return result;
}

static XrResult XRAPI_CALL GetInstanceProcAddr(XrInstance handle, const char *name,
                                               PFN_xrVoidFunction *function) {
    static const struct {
        const char *name;
        PFN_xrVoidFunction function;
    } hooks[] = {{"xrGetInstanceProcAddr", (PFN_xrVoidFunction)GetInstanceProcAddr},
                 {"xrDestroyInstance", (PFN_xrVoidFunction)DestroyInstance},
                 {"xrCreateSession", (PFN_xrVoidFunction)CreateSession},
                 {"xrDestroySession", (PFN_xrVoidFunction)DestroySession},
                 {"xrLocateViews", (PFN_xrVoidFunction)LocateViews},
                 {"xrEndFrame", (PFN_xrVoidFunction)EndFrame},
                 {"xrGetVisibilityMaskKHR", (PFN_xrVoidFunction)GetVisibilityMask}};
    lock(&g.lock);
    const Instance *instance = find_instance(handle);
    const PFN_xrGetInstanceProcAddr get = instance ? instance->get : NULL;
    unlock(&g.lock);
    if (!get || !name || !function) return XR_ERROR_HANDLE_INVALID;
    const XrResult result = get(handle, name, function);
    for (size_t i = 0; XR_SUCCEEDED(result) && i < COUNT(hooks); i++)
        if (!strcmp(name, hooks[i].name)) *function = hooks[i].function;
    return result;
}

/* ---- creating an instance ---- */

/* Creates the instance with one extension more, or with those of the application (extension NULL).
 */
static XrResult create_with(const char *extension, const XrInstanceCreateInfo *info,
                            const CreateInfo *layer, XrInstance *handle) {
    CreateInfo down = *layer;
    XrInstanceCreateInfo more = *info;
    const char **names = NULL;
    down.next_info = layer->next_info->next;
    if (extension) {
        names = calloc(info->enabledExtensionCount + 1, sizeof *names);
        if (!names) return XR_ERROR_OUT_OF_MEMORY;
        for (uint32_t i = 0; i < info->enabledExtensionCount; i++)
            names[i] = info->enabledExtensionNames[i];
        names[more.enabledExtensionCount++] = extension;
        more.enabledExtensionNames = names;
    }
    const XrResult result = layer->next_info->create(&more, &down, handle);
    free(names);
    return result;
}

/* The first of EXTENSIONS that the runtime has; NULL if none. */
static const char *extension_of(XrInstance handle, PFN_xrGetInstanceProcAddr get) {
    PFN_xrEnumerateInstanceExtensionProperties list = NULL;
    uint32_t count = 0;
    if (XR_FAILED(
            get(handle, "xrEnumerateInstanceExtensionProperties", (PFN_xrVoidFunction *)&list)) ||
        !list)
        return NULL;
    if (XR_FAILED(list(NULL, 0, &count, NULL)) || !count) return NULL;
    XrExtensionProperties *all = calloc(count, sizeof *all);
    for (uint32_t i = 0; all && i < count; i++) all[i].type = XR_TYPE_EXTENSION_PROPERTIES;
    const char *found = NULL;
    if (all && XR_SUCCEEDED(list(NULL, count, &count, all)))
        for (size_t k = 0; k < COUNT(EXTENSIONS) && !found; k++)
            for (uint32_t i = 0; i < count; i++)
                if (!strcmp(all[i].extensionName, EXTENSIONS[k])) found = EXTENSIONS[k];
    free(all);
    return found;
}

static XrResult XRAPI_CALL CreateInstance(const XrInstanceCreateInfo *info, const CreateInfo *layer,
                                          XrInstance *handle) {
    if (!info || !layer || !layer->next_info || strcmp(layer->next_info->layer_name, NAME))
        return XR_ERROR_INITIALIZATION_FAILED;
    const PFN_xrGetInstanceProcAddr get = layer->next_info->get;
    XrResult result = create_with(NULL, info, layer, handle);
    const char *extension = XR_SUCCEEDED(result) ? extension_of(*handle, get) : NULL;
    bool is_enabled = false;
    for (uint32_t i = 0; extension && i < info->enabledExtensionCount; i++)
        is_enabled |= !strcmp(info->enabledExtensionNames[i], extension);
    PFN_xrDestroyInstance destroy = NULL;
    if (extension && !is_enabled) { /* asked for only where it is: a failed attempt upsets other layers */
        get(*handle, "xrDestroyInstance", (PFN_xrVoidFunction *)&destroy);
        destroy(*handle);
        result = create_with(extension, info, layer, handle);
    }
    if (XR_FAILED(result)) return result;
    lock(&g.lock);
    const bool is_below = find_instance(*handle); /* installed twice: once is enough */
    unlock(&g.lock);
    if (is_below) return result;
    get(*handle, "xrDestroyInstance", (PFN_xrVoidFunction *)&destroy);
    Instance *made = calloc(1, sizeof *made);
    if (!made) {
        destroy(*handle);
        return XR_ERROR_OUT_OF_MEMORY;
    }
    PFN_xrGetInstanceProperties get_properties = NULL;
    made->handle = *handle;
    made->get = get;
    made->destroy_instance = destroy;
    made->has_plane = extension == EXTENSIONS[0];
    made->has_focus = extension == EXTENSIONS[1];
    get(*handle, "xrCreateSession", (PFN_xrVoidFunction *)&made->create_session);
    get(*handle, "xrDestroySession", (PFN_xrVoidFunction *)&made->destroy_session);
    get(*handle, "xrLocateViews", (PFN_xrVoidFunction *)&made->locate_views);
    get(*handle, "xrEndFrame", (PFN_xrVoidFunction *)&made->end_frame);
    get(*handle, "xrGetVisibilityMaskKHR", (PFN_xrVoidFunction *)&made->get_mask);
    get(*handle, "xrGetInstanceProperties", (PFN_xrVoidFunction *)&get_properties);
    XrInstanceProperties runtime = {.type = XR_TYPE_INSTANCE_PROPERTIES};
    if (get_properties && XR_SUCCEEDED(get_properties(*handle, &runtime)))
        snprintf(made->runtime, sizeof made->runtime, "%.*s", (int)sizeof made->runtime - 1,
                 runtime.runtimeName);
    snprintf(made->application, sizeof made->application, "%.*s", (int)sizeof made->application - 1,
             info->applicationInfo.applicationName);
    lock(&life);
    read_calibration();
    lock(&g.lock);
    const bool is_first = !g.instances;
    made->next = g.instances;
    g.instances = made;
    unlock(&g.lock);
    if (is_first && !start()) { /* without the thread nothing would ever be taken back */
        lock(&g.lock);
        g.instances = NULL;
        unlock(&g.lock);
        destroy(*handle);
        free(made);
        result = XR_ERROR_INITIALIZATION_FAILED;
    }
    unlock(&life);
    return result;
}

EXPORT XrResult XRAPI_CALL xrNegotiateLoaderApiLayerInterface(const LoaderInfo *loader,
                                                              const char *name,
                                                              LayerRequest *request) {
    if (!loader || !request || loader->type != LOADER_INFO || request->type != LAYER_REQUEST ||
        loader->min_interface > INTERFACE_VERSION || loader->max_interface < INTERFACE_VERSION ||
        (name && strcmp(name, NAME)))
        return XR_ERROR_INITIALIZATION_FAILED;
    request->interface_version = INTERFACE_VERSION;
    request->api =
        XR_CURRENT_API_VERSION < loader->max_api ? XR_CURRENT_API_VERSION : loader->max_api;
    request->get = GetInstanceProcAddr;
    request->create = CreateInstance;
    return XR_SUCCESS;
}

/* For a part of the application that corrects by itself, such as handcal's Unity component: its
 * name, as long as it does; NULL or empty afterwards. The layer passes all through meanwhile. */
EXPORT void handcal_correction_owner(const char *name) {
    lock(&g.lock);
    snprintf(g.owner, sizeof g.owner, "%s", name ? name : "");
    plain(g.owner);
    unlock(&g.lock);
}
