/* A disk that fails: preloaded under a program, it counts what the program does to files in one folder, and fails one of these, or all from
 * one on. Or it writes down all of them, so that a power cut can be played afterwards at any of them.
 *
 *   FAULT_FOLDER  the folder, as the program names it
 *   FAULT_AT      which one fails, from 0; none without it
 *   FAULT_HOW     "EIO": that one alone; "ENOSPC": every write from there on
 *   FAULT_LOG     where all of them are written down: kind (1 byte), length of the path (4), path, offset (8), length (4), bytes
 *
 * Kinds: o a file is created, w bytes, t a new length, s what was written to a file is safe, d what was done to names is safe, r another name,
 * u a name is gone.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#define FILES 4096
#define REAL(name) ((__typeof__(&name))real(#name))

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static char *paths[FILES];
static long done_so_far;

static void *real(const char *name) { return dlsym(RTLD_NEXT, name); }

static int watched(const char *path) {
    const char *folder = getenv("FAULT_FOLDER");
    return folder && path && strncmp(path, folder, strlen(folder)) == 0;
}

static char *path_of(int fd) { return fd >= 0 && fd < FILES ? paths[fd] : NULL; }

static void put(int log, const void *bytes, size_t count) {
    const char *from = bytes;
    while (count > 0) {
        ssize_t written = REAL(write)(log, from, count);
        if (written <= 0) abort();
        from += written, count -= (size_t)written;
    }
}

/* Whether what is about to be done fails, errno then says how; if not, it is written down. */
static int fails(char kind, const char *path, uint64_t offset, const void *bytes, uint32_t length) {
    const char *at = getenv("FAULT_AT"), *how = getenv("FAULT_HOW"), *to = getenv("FAULT_LOG");
    static int log = -1;
    int failed = 0;
    pthread_mutex_lock(&lock);
    long number = done_so_far++;
    if (at) {
        int full = how && strcmp(how, "ENOSPC") == 0;
        if (full ? number >= atol(at) && strchr("owtr", kind) : number == atol(at)) {
            errno = full ? ENOSPC : EIO;
            failed = 1;
        }
    }
    if (!failed && to) {
        if (log < 0) log = REAL(open)(to, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
        uint32_t size = (uint32_t)strlen(path);
        put(log, &kind, 1), put(log, &size, 4), put(log, path, size);
        put(log, &offset, 8), put(log, &length, 4), put(log, bytes, length);
    }
    pthread_mutex_unlock(&lock);
    return failed;
}

static int opened(int fd, const char *path) {
    if (fd >= 0 && fd < FILES && watched(path)) {
        char *old = paths[fd];
        paths[fd] = strdup(path);
        free(old);
    }
    return fd;
}

static int open_it(int (*call)(const char *, int, ...), const char *path, int flags, mode_t mode) {
    if (watched(path) && (flags & O_CREAT) && access(path, F_OK) != 0 && fails('o', path, 0, "", 0)) return -1;
    return opened(call(path, flags, mode), path);
}

#define OPENING(name)                                          \
    int name(const char *path, int flags, ...) {               \
        mode_t mode = 0;                                       \
        if (flags & (O_CREAT | O_TMPFILE)) {                   \
            va_list more;                                      \
            va_start(more, flags);                             \
            mode = va_arg(more, mode_t);                       \
            va_end(more);                                      \
        }                                                      \
        return open_it(REAL(name), path, flags, mode);         \
    }
OPENING(open)
OPENING(open64)

int close(int fd) {
    if (path_of(fd)) {
        free(paths[fd]);
        paths[fd] = NULL;
    }
    return REAL(close)(fd);
}

static off_t place(int fd) {
    int flags = fcntl(fd, F_GETFL);
    struct stat there;
    if (flags >= 0 && (flags & O_APPEND) && fstat(fd, &there) == 0) return there.st_size;
    return lseek(fd, 0, SEEK_CUR);
}

ssize_t write(int fd, const void *bytes, size_t count) {
    if (path_of(fd) && fails('w', path_of(fd), (uint64_t)place(fd), bytes, (uint32_t)count)) return -1;
    return REAL(write)(fd, bytes, count);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    if (!path_of(fd)) return REAL(writev)(fd, parts, count);
    ssize_t all = 0;
    for (int i = 0; i < count; i++) {
        ssize_t one = write(fd, parts[i].iov_base, parts[i].iov_len);
        if (one < 0) return all > 0 ? all : one;
        all += one;
        if ((size_t)one < parts[i].iov_len) break;
    }
    return all;
}

ssize_t pwrite(int fd, const void *bytes, size_t count, off_t at) {
    if (path_of(fd) && fails('w', path_of(fd), (uint64_t)at, bytes, (uint32_t)count)) return -1;
    return REAL(pwrite)(fd, bytes, count, at);
}

ssize_t pwrite64(int fd, const void *bytes, size_t count, off64_t at) {
    if (path_of(fd) && fails('w', path_of(fd), (uint64_t)at, bytes, (uint32_t)count)) return -1;
    return REAL(pwrite64)(fd, bytes, count, at);
}

static int sync_fails(int fd) {
    struct stat there;
    if (!path_of(fd)) return 0;
    char kind = fstat(fd, &there) == 0 && S_ISDIR(there.st_mode) ? 'd' : 's';
    return fails(kind, path_of(fd), 0, "", 0);
}

int fsync(int fd) { return sync_fails(fd) ? -1 : REAL(fsync)(fd); }

int fdatasync(int fd) { return sync_fails(fd) ? -1 : REAL(fdatasync)(fd); }

int ftruncate(int fd, off_t length) {
    if (path_of(fd) && fails('t', path_of(fd), (uint64_t)length, "", 0)) return -1;
    return REAL(ftruncate)(fd, length);
}

int ftruncate64(int fd, off64_t length) {
    if (path_of(fd) && fails('t', path_of(fd), (uint64_t)length, "", 0)) return -1;
    return REAL(ftruncate64)(fd, length);
}

int rename(const char *from, const char *to) {
    if ((watched(from) || watched(to)) && fails('r', from, 0, to, (uint32_t)strlen(to))) return -1;
    return REAL(rename)(from, to);
}

int unlink(const char *path) {
    if (watched(path) && fails('u', path, 0, "", 0)) return -1;
    return REAL(unlink)(path);
}
