/* Of OpenXR's loader and of newer headers, for the layer and the test runtime. The interface of the
 * loader is in openxr_loader_negotiation.h only since 1.0.33. */
#ifndef HANDCAL_LOADER_H
#define HANDCAL_LOADER_H

#include <openxr/openxr.h>

struct CreateInfo;

typedef struct NextInfo {
    int type;
    uint32_t version;
    size_t size;
    char layer_name[XR_MAX_API_LAYER_NAME_SIZE];
    PFN_xrGetInstanceProcAddr get;
    XrResult(XRAPI_PTR *create)(const XrInstanceCreateInfo *, const struct CreateInfo *,
                                XrInstance *);
    struct NextInfo *next;
} NextInfo;

typedef struct CreateInfo {
    int type;
    uint32_t version;
    size_t size;
    void *loader_instance;
    char settings_file[512];
    NextInfo *next_info;
} CreateInfo;

typedef struct {
    int type;
    uint32_t version;
    size_t size;
    uint32_t min_interface, max_interface;
    XrVersion min_api, max_api;
} LoaderInfo;

/* What a layer and a runtime answer with; `create` is a layer's only. */
typedef struct {
    int type;
    uint32_t version;
    size_t size;
    uint32_t interface_version;
    XrVersion api;
    PFN_xrGetInstanceProcAddr get;
} RuntimeRequest;

typedef struct {
    int type;
    uint32_t version;
    size_t size;
    uint32_t interface_version;
    XrVersion api;
    PFN_xrGetInstanceProcAddr get;
    XrResult(XRAPI_PTR *create)(const XrInstanceCreateInfo *, const CreateInfo *, XrInstance *);
} LayerRequest;

enum { LOADER_INFO = 1, LAYER_REQUEST = 2, INTERFACE_VERSION = 1 };

/* XR_ML_frame_end_info; newer than Debian 12's header. */
typedef struct {
    XrStructureType type;
    const void *next;
    float focus_distance;
    XrFlags64 flags;
} FrameEndInfoML;
enum { TYPE_FRAME_END_INFO_ML = 1000135000 };

#endif
