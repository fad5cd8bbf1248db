/* A disk that fails, between labrig and the real one: preloaded, and armed by the campaign.
 *
 * Of the calls that change something below one folder, the `fail_at`-th fails with EIO: `write`,
 * `fsync`, `close`, `rename`, `ftruncate`, `mkdir`, `unlink`, and `open` for writing.
 *
 * LOST: nothing is done. Bytes whose fsync failed are still seen by whoever reads them, as Linux
 *       has it, and are zeros after the power cut at the end, if nobody wrote there again.
 * DONE: it fails, although all of it was done.
 * DEAD: as LOST, and every later call fails, too.
 * READ_ONLY: as DEAD, with EROFS, as a file system that has found an error of its own.
 * FULL: the disk has room for `fail_at` bytes more; a write takes what fits, the next ones get ENOSPC.
 */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum { LOST, DONE, DEAD, READ_ONLY, FULL };
enum { MOST_FILES = 1024, MOST_CUTS = 64 };

static char folder[PATH_MAX];
static long fail_at, calls, written;
static int kind;

/* Of each open file: whether it is written to, how much of it the disk has, and the bytes that a failed fsync has dropped. */
static int for_writing[MOST_FILES];
static off_t synced[MOST_FILES], lost_from[MOST_FILES], lost_to[MOST_FILES];
static struct { char path[PATH_MAX]; off_t from, to; } cuts[MOST_CUTS];
static int cut_count;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int below(const char *path) {
    return folder[0] && strncmp(path, folder, strlen(folder)) == 0;
}

static int path_of(int fd, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, PATH_MAX - 1);
    if (length < 0 || fd < 0 || fd >= MOST_FILES) return 0;
    path[length] = 0;
    return below(path);
}

static int file_below(int fd) {
    int before = errno;
    char path[PATH_MAX];
    int is_below = folder[0] && path_of(fd, path);
    errno = before;
    return is_below;
}

static off_t size_of(int fd) {
    struct stat is;
    return fstat(fd, &is) ? 0 : is.st_size;
}

/* Whether this call, the next one that changes something, is to fail. */
static int fails(void) {
    calls++;
    if (!fail_at || kind == FULL) return 0;
    return kind == DEAD || kind == READ_ONLY ? calls >= fail_at : calls == fail_at;
}

static int failed(void) {
    errno = kind == READ_ONLY ? EROFS : kind == FULL ? ENOSPC : EIO;
    return -1;
}

/* How much of a write there is room for. */
static size_t fitting(size_t size) {
    if (!fail_at || kind != FULL || written + (long)size <= fail_at) return size;
    return written < fail_at ? fail_at - written : 0;
}

void arm(const char *where, long at, int how) {
    snprintf(folder, sizeof folder, "%s", where);
    fail_at = at, kind = how, calls = 0, cut_count = 0, written = 0;
    for (int fd = 0; fd < MOST_FILES; fd++) lost_from[fd] = -1;
}

/* The power goes: what was dropped is not there any more. Returns how many calls there were. */
long cut_power(void) {
    folder[0] = 0;
    for (int cut = 0; cut < cut_count; cut++) {
        int fd = REAL(open)(cuts[cut].path, O_WRONLY);
        if (fd < 0) continue;
        off_t to = size_of(fd) < cuts[cut].to ? size_of(fd) : cuts[cut].to;
        for (off_t at = cuts[cut].from; at < to; at++)
            if (pwrite(fd, "", 1, at) != 1) break;
        REAL(close)(fd);
    }
    return calls;
}

/* How many bytes were written since it was armed. */
long written_bytes(void) { return written; }

static void note_lost(int fd) {
    if (lost_from[fd] < 0 || cut_count == MOST_CUTS || !path_of(fd, cuts[cut_count].path)) return;
    cuts[cut_count].from = lost_from[fd], cuts[cut_count].to = lost_to[fd];
    cut_count++;
    lost_from[fd] = -1;
}

static void written_again(int fd, off_t from) {
    if (lost_from[fd] >= from) lost_from[fd] = -1;
    else if (lost_to[fd] > from) lost_to[fd] = from;
}

static int opened(int fd, int writes) {
    if (fd >= 0 && fd < MOST_FILES)
        for_writing[fd] = writes, synced[fd] = size_of(fd), lost_from[fd] = -1;
    return fd;
}


static int open_or_fail(int (*real)(const char *, int, ...), const char *path, int flags,
                        mode_t mode) {
    int writes = flags & (O_WRONLY | O_RDWR);
    if (!writes || !below(path) || !fails()) return opened(real(path, flags, mode), writes);
    int fd = kind == DONE ? real(path, flags, mode) : -1;
    if (fd >= 0) REAL(close)(fd);
    return failed();
}

int open(const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t mode = va_arg(rest, mode_t);
    va_end(rest);
    return open_or_fail(REAL(open), path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t mode = va_arg(rest, mode_t);
    va_end(rest);
    return open_or_fail(REAL(open64), path, flags, mode);
}

ssize_t write(int fd, const void *data, size_t size) {
    int ours = file_below(fd), fail = ours && fails();
    if (fail && kind != DONE) return failed();
    off_t from = ours ? size_of(fd) : 0; /* labrig appends; a result's files are made anew */
    size_t fits = ours ? fitting(size) : size;
    if (!fits && size) return failed();
    ssize_t done = REAL(write)(fd, data, fits);
    if (ours) written_again(fd, from), written += done;
    return fail ? failed() : done;
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t at) {
    int ours = file_below(fd), fail = ours && fails();
    if (fail && kind != DONE) return failed();
    size_t fits = ours ? fitting(size) : size;
    if (!fits && size) return failed();
    ssize_t done = REAL(pwrite)(fd, data, fits, at);
    if (ours) written += done;
    return fail ? failed() : done;
}

ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at) {
    return pwrite(fd, data, size, at);
}

int ftruncate(int fd, off_t size) {
    int ours = file_below(fd), fail = ours && fails();
    if (fail && kind != DONE) return failed();
    int done = REAL(ftruncate)(fd, size);
    if (ours) written_again(fd, size);
    return fail ? failed() : done;
}

int ftruncate64(int fd, off64_t size) { return ftruncate(fd, size); }

int fsync(int fd) {
    int ours = file_below(fd);
    if (ours && fails()) {
        if (kind == DONE) REAL(fsync)(fd);
        else lost_from[fd] = synced[fd], lost_to[fd] = size_of(fd);
        return failed();
    }
    if (ours) synced[fd] = size_of(fd);
    return REAL(fsync)(fd);
}

int close(int fd) { /* Linux gives the descriptor back whatever it answers. */
    int fail = file_below(fd) && for_writing[fd] && fails();
    if (folder[0] && fd >= 0 && fd < MOST_FILES) note_lost(fd), for_writing[fd] = 0;
    int done = REAL(close)(fd);
    return fail ? failed() : done;
}

int rename(const char *from, const char *to) {
    int fail = below(to) && fails();
    if (fail && kind != DONE) return failed();
    int done = REAL(rename)(from, to);
    return fail ? failed() : done;
}

int mkdir(const char *path, mode_t mode) {
    int fail = below(path) && fails();
    if (fail && kind != DONE) return failed();
    int done = REAL(mkdir)(path, mode);
    return fail ? failed() : done;
}

int unlink(const char *path) {
    int fail = below(path) && fails();
    if (fail && kind != DONE) return failed();
    int done = REAL(unlink)(path);
    return fail ? failed() : done;
}
