/* See views.h. Computes in double; OpenXR's own numbers are floats. */
#include "views.h"

#include <math.h>
#include <string.h>

static const double FARTHEST_MM = 1.0, LARGEST_TANGENT = 1e-3, LARGEST_TURN = 1e-3;

/* ---- poses: x y z w, then metres ---- */

static void from_xr(const XrPosef *pose, double to[7]) {
    const double q[4] = {pose->orientation.x, pose->orientation.y, pose->orientation.z,
                         pose->orientation.w};
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++) to[i] = length > 0.5 ? q[i] / length : i == 3;
    to[4] = pose->position.x, to[5] = pose->position.y, to[6] = pose->position.z;
}

static XrPosef to_xr(const double p[7]) {
    return (XrPosef){{(float)p[0], (float)p[1], (float)p[2], (float)p[3]},
                     {(float)p[4], (float)p[5], (float)p[6]}};
}

static void rotate(const double q[4], const double v[3], double to[3]) {
    double t[3];
    for (int i = 0; i < 3; i++)
        t[i] = 2.0 * (q[(i + 1) % 3] * v[(i + 2) % 3] - q[(i + 2) % 3] * v[(i + 1) % 3]);
    for (int i = 0; i < 3; i++)
        to[i] =
            v[i] + q[3] * t[i] + q[(i + 1) % 3] * t[(i + 2) % 3] - q[(i + 2) % 3] * t[(i + 1) % 3];
}

static void multiply(const double a[7], const double b[7], double to[7]) {
    double r[7];
    for (int i = 0; i < 3; i++)
        r[i] = a[3] * b[i] + a[i] * b[3] + a[(i + 1) % 3] * b[(i + 2) % 3] -
               a[(i + 2) % 3] * b[(i + 1) % 3];
    r[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
    rotate(a, b + 4, r + 4);
    for (int i = 4; i < 7; i++) r[i] += a[i];
    memcpy(to, r, sizeof r);
}

static void invert(const double a[7], double to[7]) {
    double back[3] = {-a[4], -a[5], -a[6]}, q[4] = {-a[0], -a[1], -a[2], a[3]};
    rotate(q, back, to + 4);
    memcpy(to, q, sizeof q);
}

/* to = inverse(a) b */
static void between(const double a[7], const double b[7], double to[7]) {
    double back[7];
    invert(a, back);
    multiply(back, b, to);
}

/* ---- fields of view: tangents left, right, up, down ---- */

static void tangents(const XrFovf *fov, double to[4]) {
    to[0] = tan(fov->angleLeft), to[1] = tan(fov->angleRight);
    to[2] = tan(fov->angleUp), to[3] = tan(fov->angleDown);
}

static XrFovf angles(const double edge[4]) {
    return (XrFovf){(float)atan(edge[0]), (float)atan(edge[1]), (float)atan(edge[2]),
                    (float)atan(edge[3])};
}

static double mapped(double tangent, const double from[2], const double to[2]) {
    return to[0] + (tangent - from[0]) * (to[1] - to[0]) / (from[1] - from[0]);
}

/* Maps a part of the field `from` to the same part of the field `to`. */
static XrFovf part(const XrFovf *fov, const double from[4], const double to[4]) {
    double edge[4];
    tangents(fov, edge);
    for (int i = 0; i < 4; i++) edge[i] = mapped(edge[i], from + i / 2 * 2, to + i / 2 * 2);
    return angles(edge);
}

/* ---- the calibration file: JSON, each number at its path ---- */

typedef struct {
    const char *at, *end;
    char path[128];
    int depth;
    HandcalCalibration found;
    unsigned long long seen;
    double version;
} Reader;

static const char *const VIEW_FIELDS[] = {"orientation.x", "orientation.y", "orientation.z",
                                          "orientation.w", "position.x",    "position.y",
                                          "position.z",    "fov.angleLeft", "fov.angleRight",
                                          "fov.angleUp",   "fov.angleDown"};
enum { FIELDS = 11, SINGLE = 4 * FIELDS };

/* Where the number of a path belongs, and its bit among those seen; NULL: it is not used. */
static double *place(Reader *r, int *bit) {
    HandcalCalibration *c = &r->found;
    const struct {
        const char *path;
        double *to;
    } single[] = {{"handcalOpenxr", &r->version},
                  {"imageDistanceM", &c->image_m},
                  {"expiresUnixS", &c->expires_unix_s},
                  {"movingEyes", &c->moving_eyes}};
    for (int i = 0; i < 4; i++)
        if (!strcmp(r->path, single[i].path)) return *bit = SINGLE + i, single[i].to;
    if (strncmp(r->path, "views.", 6) || (r->path[6] != '0' && r->path[6] != '1') ||
        r->path[7] != '.')
        return NULL;
    const int eye = r->path[6] - '0';
    const char *rest = r->path + 8;
    const bool is_own = !strncmp(rest, "own.", 4);
    if (is_own) rest += 4;
    const char *prefix = is_own ? "pose." : "inView.";
    const bool is_posed = !strncmp(rest, prefix, strlen(prefix));
    if (is_posed) rest += strlen(prefix);
    for (int i = is_posed ? 0 : 7; i < (is_posed ? 7 : FIELDS); i++)
        if (!strcmp(rest, VIEW_FIELDS[i])) {
            *bit = (2 * is_own + eye) * FIELDS + i;
            if (i < 7) return (is_own ? c->own_pose : c->pose)[eye] + i;
            return (is_own ? c->own_edge : c->edge)[eye] + i - 7;
        }
    return NULL;
}

static void skip_space(Reader *r) {
    while (r->at < r->end && strchr(" \t\r\n", *r->at) && *r->at) r->at++;
}

static bool take(Reader *r, char wanted) {
    skip_space(r);
    return r->at < r->end && *r->at == wanted && ++r->at;
}

/* A string without its escapes decoded, cut to `size`: no key or name that is used needs them. */
static bool read_string(Reader *r, char *to, size_t size) {
    size_t length = 0;
    if (!take(r, '"')) return false;
    for (; r->at < r->end && *r->at != '"'; r->at++) {
        if (*r->at == '\\' && ++r->at == r->end) return false;
        if (length + 1 < size) to[length++] = *r->at;
    }
    to[length] = 0;
    return r->at < r->end && ++r->at;
}

/* Not strtod, which follows the application's locale. */
static bool read_number(Reader *r, double *value) {
    double sign = 1.0, number = 0.0;
    int digits = 0, scale = 0, power = 0, power_sign = 1;
    if (r->at < r->end && *r->at == '-') sign = -1.0, r->at++;
    for (bool is_fraction = false; r->at < r->end; r->at++) {
        if (*r->at == '.' && !is_fraction && digits) is_fraction = true;
        else if (*r->at >= '0' && *r->at <= '9')
            number = 10.0 * number + (*r->at - '0'), digits++, scale -= is_fraction;
        else break;
    }
    if (!digits) return false;
    if (r->at < r->end && (*r->at == 'e' || *r->at == 'E')) {
        if (++r->at < r->end && (*r->at == '-' || *r->at == '+'))
            power_sign = *r->at++ == '-' ? -1 : 1;
        for (digits = 0; r->at < r->end && *r->at >= '0' && *r->at <= '9'; r->at++)
            if (digits++ < 3) power = 10 * power + (*r->at - '0');
        if (!digits || digits > 3) return false;
    }
    for (scale += power_sign * power; scale > 0; scale--) number *= 10.0;
    for (; scale < 0; scale++) number /= 10.0;
    *value = sign * number;
    return isfinite(*value);
}

static bool read_word(Reader *r, const char *word) {
    const size_t length = strlen(word);
    if ((size_t)(r->end - r->at) < length || strncmp(r->at, word, length)) return false;
    r->at += length;
    return true;
}

static bool read_value(Reader *r);

/* The members of an object or an array; `r->path` grows by the name or index of each. */
static bool read_members(Reader *r, bool is_object) {
    const char closing = is_object ? '}' : ']';
    const size_t length = strlen(r->path);
    r->at++;
    if (++r->depth > 8) return false;
    if (!take(r, closing)) {
        for (int i = 0;; i++) {
            char key[64];
            const char index[2] = {(char)('0' + (i < 10 ? i : 9)), 0};
            if (is_object && !(read_string(r, key, sizeof key) && take(r, ':'))) return false;
            const char *name = is_object ? key : index;
            if (length + strlen(name) + 2 > sizeof r->path) return false;
            if (length) strcat(r->path, ".");
            strcat(r->path, name);
            if (!read_value(r)) return false;
            r->path[length] = 0;
            if (take(r, closing)) break;
            if (!take(r, ',')) return false;
        }
    }
    r->depth--;
    return true;
}

static bool read_value(Reader *r) {
    char text[XR_MAX_SYSTEM_NAME_SIZE];
    double number;
    int bit;
    skip_space(r);
    if (r->at == r->end) return false;
    if (*r->at == '{' || *r->at == '[') return read_members(r, *r->at == '{');
    if (*r->at == '"') {
        if (!read_string(r, text, sizeof text)) return false;
        if (!strcmp(r->path, "system")) strcpy(r->found.system, text);
        return true;
    }
    if (read_word(r, "null") || read_word(r, "true") || read_word(r, "false")) return true;
    if (!read_number(r, &number)) return false;
    double *to = place(r, &bit);
    if (to && r->seen >> bit & 1) return false; /* given twice */
    if (to) *to = number, r->seen |= 1ull << bit;
    return true;
}

/* Angles to tangents; false if they are no field of view. */
static bool is_field(double edge[4]) {
    for (int i = 0; i < 4; i++)
        if (!(fabs(edge[i]) < 1.5)) return false; /* rad */
    if (!(edge[0] < edge[1] && edge[3] < edge[2])) return false;
    for (int i = 0; i < 4; i++) edge[i] = tan(edge[i]);
    return edge[1] - edge[0] > 1e-3 && edge[2] - edge[3] > 1e-3;
}

static bool is_pose(double pose[7], double farthest_m) {
    double square = 0.0;
    for (int i = 0; i < 4; i++) square += pose[i] * pose[i];
    if (!(fabs(square - 1.0) < 1e-3)) return false;
    for (int i = 0; i < 4; i++) pose[i] /= sqrt(square);
    for (int i = 4; i < 7; i++)
        if (!(fabs(pose[i]) <= farthest_m)) return false;
    return true;
}

const char *handcal_read(const char *text, size_t length, HandcalCalibration *to) {
    Reader r = {.at = text, .end = text + length};
    const unsigned long long view = (1ull << FIELDS) - 1, all = (1ull << 4 * FIELDS) - 1;
    if (length > HANDCAL_LONGEST) return "it is too large";
    if (!read_value(&r)) return "it is not JSON as handcal writes it";
    skip_space(&r);
    if (r.at != r.end) return "something follows its end";
    if (!(r.seen >> SINGLE & 1) || r.version != 1.0) return "it is not of this version of handcal";
    unsigned long long needed = all; /* but the fields of view of V, which a rig need not know */
    for (int eye = 0; eye < 2; eye++) {
        const unsigned long long own = view << (2 + eye) * FIELDS, fov = own & ~((own >> 4) & own);
        if (!(r.seen & fov)) needed &= ~fov;
    }
    if ((r.seen & needed) != needed) return "a number is missing; export it again";
    for (int eye = 0; eye < 2; eye++) {
        if (!is_pose(r.found.pose[eye], 0.2) || !is_pose(r.found.own_pose[eye], 1.0))
            return "a pose is impossible";
        if (!is_field(r.found.edge[eye])) return "a field of view is impossible";
        const bool is_known = needed >> ((2 + eye) * FIELDS + 7) & 1;
        if (is_known && !is_field(r.found.own_edge[eye])) return "a field of view is impossible";
    }
    if (r.found.image_m < 0.0 || r.found.image_m > 1e6)
        return "the distance of the image is impossible";
    *to = r.found;
    return NULL;
}

/* ---- frames ---- */

static HandcalState refusal(const HandcalCalibration *c, double pose[][7], double edge[][4],
                            uint32_t count, double *measured) {
    double own[7], rig[7], off[7];
    between(pose[0], pose[1], own);
    between(c->own_pose[0], c->own_pose[1], rig);
    if (!c->moving_eyes) {
        *measured =
            1e3 * sqrt(pow(own[4] - rig[4], 2) + pow(own[5] - rig[5], 2) + pow(own[6] - rig[6], 2));
        if (!(*measured <= FARTHEST_MM)) return HANDCAL_OTHER_DISTANCE;
    }
    between(rig, own, off);
    *measured = 2e3 * sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]);
    if (!(*measured <= 1e3 * LARGEST_TURN)) return HANDCAL_OTHER_DIRECTION;
    for (uint32_t eye = 0; eye < 2; eye++) {
        const double *known = c->own_edge[eye];
        *measured = 0.0;
        for (int i = 0; i < 4; i++)
            if (known[0] != known[1] && !c->moving_eyes)
                *measured = fmax(*measured, 1e3 * fabs(edge[eye][i] - known[i]));
        if (!(*measured <= 1e3 * LARGEST_TANGENT)) return HANDCAL_OTHER_FIELD;
        if (!(edge[eye][1] != edge[eye][0] && edge[eye][2] != edge[eye][3]))
            return HANDCAL_OTHER_FIELD;
        /* Views of the middle look from the same pose. */
        if (count == 4) {
            between(pose[eye], pose[eye + 2], off);
            for (int i = 0; i < 7; i++)
                if (i != 3 && !(fabs(off[i]) <= 1e-3)) return HANDCAL_OTHER_VIEWS;
        }
    }
    return HANDCAL_ACTIVE;
}

void handcal_locate(HandcalViews *views, const HandcalCalibration *c, XrViewStateFlags flags,
                    const XrView *in_view, uint32_t count, XrView *located) {
    double pose[HANDCAL_VIEWS][7], edge[HANDCAL_VIEWS][4];
    for (uint32_t i = 0; i < count; i++) {
        from_xr(&located[i].pose, pose[i]);
        tangents(&located[i].fov, edge[i]);
    }
    const bool has_turn = flags & XR_VIEW_STATE_ORIENTATION_VALID_BIT;
    const bool has_place = has_turn && flags & XR_VIEW_STATE_POSITION_VALID_BIT;
    views->state = HANDCAL_OFF;
    if (c) {
        /* Without valid poses nothing can be compared, and nothing is shown that has a place. */
        views->state = has_place && (in_view || !c->moving_eyes)
                           ? refusal(c, pose, edge, count, &views->measured)
                           : HANDCAL_WAITING;
    }
    for (uint32_t i = 0; i < count; i++) {
        const XrView own = located[i];
        double offset[7] = {0, 0, 0, 1, 0, 0, 0};
        if (views->state == HANDCAL_ACTIVE) {
            double given[7];
            if (c->moving_eyes) {
                double in_head[7], calibrated[7];
                from_xr(&in_view[i].pose, in_head);
                multiply(c->own_pose[i % 2], c->pose[i % 2], calibrated);
                between(in_head, calibrated, offset);
            } else {
                memcpy(offset, c->pose[i % 2], sizeof offset);
            }
            multiply(pose[i], offset, given);
            located[i].pose = to_xr(given);
            located[i].fov =
                i < 2 ? angles(c->edge[i]) : part(&own.fov, edge[i % 2], c->edge[i % 2]);
        }
        const unsigned slot = views->next++ % HANDCAL_KEPT;
        views->kept[slot].is_used = true;
        views->kept[slot].view = i;
        views->kept[slot].given_pose = located[i].pose, views->kept[slot].own_pose = own.pose;
        views->kept[slot].given_fov = located[i].fov, views->kept[slot].own_fov = own.fov;
        memcpy(views->kept[slot].offset, offset, sizeof offset);
    }
}

/* The slot of the newest view that was given, with this pose if there is one; -1: none. */
static int newest(const HandcalViews *views, uint32_t view, const XrPosef *pose) {
    int any = -1;
    for (unsigned back = 1; back <= HANDCAL_KEPT; back++) {
        const int slot = (int)((views->next - back) % HANDCAL_KEPT);
        if (!views->kept[slot].is_used || views->kept[slot].view != view) continue;
        if (pose && !memcmp(&views->kept[slot].given_pose, pose, sizeof *pose)) return slot;
        if (any < 0) any = slot;
    }
    return any;
}

void handcal_submit(const HandcalViews *views, uint32_t view, XrPosef *pose, XrFovf *fov) {
    const int slot = newest(views, view, pose);
    if (slot < 0) return;
    if (!memcmp(&views->kept[slot].given_pose, pose, sizeof *pose)) {
        *pose = views->kept[slot].own_pose; /* exact, however far the space's origin is */
    } else {
        double given[7], back[7];
        from_xr(pose, given);
        invert(views->kept[slot].offset, back);
        multiply(given, back, given);
        *pose = to_xr(given);
    }
    if (!memcmp(&views->kept[slot].given_fov, fov, sizeof *fov)) {
        *fov = views->kept[slot].own_fov;
    } else if (memcmp(&views->kept[slot].given_fov, &views->kept[slot].own_fov, sizeof *fov)) {
        double from[4], to[4];
        tangents(&views->kept[slot].given_fov, from);
        tangents(&views->kept[slot].own_fov, to);
        *fov = part(fov, from, to);
    }
}

void handcal_mask(const HandcalViews *views, const HandcalCalibration *c, uint32_t view,
                  uint32_t count, XrVector2f *vertices) {
    double from[4], to[4];
    const int slot = newest(views, view, NULL);
    if (slot >= 0) {
        tangents(&views->kept[slot].own_fov, from);
        tangents(&views->kept[slot].given_fov, to);
    } else {
        if (!c || c->own_edge[view % 2][0] == c->own_edge[view % 2][1]) return;
        memcpy(from, c->own_edge[view % 2], sizeof from);
        memcpy(to, c->edge[view % 2], sizeof to);
    }
    if (from[0] == from[1] || from[2] == from[3]) return;
    for (uint32_t i = 0; i < count; i++) {
        vertices[i].x = (float)mapped(vertices[i].x, from, to);
        vertices[i].y = (float)mapped(vertices[i].y, from + 2, to + 2);
    }
}
