/* Faults at the n-th call of the system under a folder; loaded before libc.

   FAULT_ROOT is the folder. fault_arm(n, mode) lets the n-th call from now fail, n from 1;
   fault_count() returns the number of calls since. While paused, none counts. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { IO_ERROR = 1, DISK_FULL, SHORT_WRITE, DIE_BEFORE, DIE_HALFWAY, DIE_AFTER };

static long count, at = -1;
static int mode, paused;

void fault_pause(int is_paused) { paused = is_paused; }
void fault_arm(long n, int what) { count = 0; at = n; mode = what; }
long fault_count(void) { return count; }

static int is_inside(const char *path) {
    const char *root = getenv("FAULT_ROOT");
    return root && path && !strncmp(path, root, strlen(root));
}

static int is_open_inside(int fd) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return is_inside(path);
}

/* Count a call; return the fault that it meets, or 0. */
static int meet(void) {
    if (at < 0 || paused || ++count != at) return 0;
    if (mode == DIE_BEFORE) _exit(99);
    return mode;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL(fault) \
    if (fault == IO_ERROR || fault == DISK_FULL) { \
        errno = fault == IO_ERROR ? EIO : ENOSPC; \
        return -1; \
    }
#define CALL(inside, call) \
    int fault = inside ? meet() : 0; \
    FAIL(fault) \
    int result = call; \
    if (fault == DIE_AFTER || fault == DIE_HALFWAY) _exit(99); \
    return result;

int open(const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    int bits = flags & O_CREAT ? va_arg(list, int) : 0;
    va_end(list);
    CALL(is_inside(path), REAL(open)(path, flags, bits))
}
int open64(const char *path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    int bits = flags & O_CREAT ? va_arg(list, int) : 0;
    va_end(list);
    CALL(is_inside(path), REAL(open64)(path, flags, bits))
}
ssize_t write(int fd, const void *data, size_t size) {
    int fault = is_open_inside(fd) ? meet() : 0;
    FAIL(fault)
    if ((fault == SHORT_WRITE || fault == DIE_HALFWAY) && size > 1) size /= 2;
    ssize_t result = REAL(write)(fd, data, size);
    if (fault == DIE_AFTER || fault == DIE_HALFWAY) _exit(99);
    return result;
}
int fsync(int fd) { CALL(is_open_inside(fd), REAL(fsync)(fd)) }
int ftruncate(int fd, off_t size) { CALL(is_open_inside(fd), REAL(ftruncate)(fd, size)) }
int ftruncate64(int fd, off64_t size) { CALL(is_open_inside(fd), REAL(ftruncate64)(fd, size)) }
int rename(const char *from, const char *to) { CALL(is_inside(to), REAL(rename)(from, to)) }
int unlink(const char *path) { CALL(is_inside(path), REAL(unlink)(path)) }
int mkdir(const char *path, mode_t bits) { CALL(is_inside(path), REAL(mkdir)(path, bits)) }
