/* Library for LD_PRELOAD: system calls on files below a directory fail, as on a full disk or on a
   file system without locks.

   set_fault(call, at, lasts, error, folder): of the calls of this type on files in `folder`, number
   `at` (from 1) fails with the number `error`; if `lasts`, all later calls of all types that need
   space fail as well. count_of(call) returns the number of calls. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

enum { WRITE, SYNC, RENAME, TRUNCATE, LOCK, CALLS };

static long counts[CALLS];
static int fault = -1, lasting, number;
static long first;
static char directory[4096];

void set_fault(int call, long at, int lasts, int error, const char *folder)
{
    memset(counts, 0, sizeof counts);
    fault = call, first = at, lasting = lasts, number = error;
    snprintf(directory, sizeof directory, "%s", folder);
}

long count_of(int call) { return counts[call]; }

static int is_below(const char *path)
{
    size_t length = strlen(directory);
    return length && !strncmp(path, directory, length);
}

static int is_file_below(int descriptor)
{
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 1);
    path[length < 0 ? 0 : length] = 0;
    return is_below(path);
}

/* Count a call and return 1 if it must fail. Locks do not need space. */
static int fails(int call, int is_concerned)
{
    if (fault < 0 || !is_concerned)
        return 0;
    counts[call]++;
    int is_fault = call == fault && (counts[call] == first || (lasting && counts[call] > first));
    int is_later = lasting && fault != LOCK && call != LOCK && counts[fault] >= first;
    if (is_fault || is_later)
        errno = number;
    return is_fault || is_later;
}

#define NEXT(name, type) ((type)dlsym(RTLD_NEXT, name))

ssize_t write(int descriptor, const void *data, size_t size)
{
    if (fails(WRITE, is_file_below(descriptor)))
        return -1;
    return NEXT("write", ssize_t (*)(int, const void *, size_t))(descriptor, data, size);
}

ssize_t pwrite64(int descriptor, const void *data, size_t size, off64_t offset)
{
    if (fails(WRITE, is_file_below(descriptor)))
        return -1;
    return NEXT("pwrite64", ssize_t (*)(int, const void *, size_t, off64_t))(
        descriptor, data, size, offset);
}

ssize_t pwrite(int descriptor, const void *data, size_t size, off_t offset)
{
    return pwrite64(descriptor, data, size, offset);
}

int fsync(int descriptor)
{
    if (fails(SYNC, is_file_below(descriptor)))
        return -1;
    return NEXT("fsync", int (*)(int))(descriptor);
}

int fdatasync(int descriptor)
{
    if (fails(SYNC, is_file_below(descriptor)))
        return -1;
    return NEXT("fdatasync", int (*)(int))(descriptor);
}

int ftruncate64(int descriptor, off64_t size)
{
    if (fails(TRUNCATE, is_file_below(descriptor)))
        return -1;
    return NEXT("ftruncate64", int (*)(int, off64_t))(descriptor, size);
}

int ftruncate(int descriptor, off_t size) { return ftruncate64(descriptor, size); }

int rename(const char *before, const char *after)
{
    if (fails(RENAME, is_below(after)))
        return -1;
    return NEXT("rename", int (*)(const char *, const char *))(before, after);
}

int link(const char *before, const char *after)
{
    if (fails(RENAME, is_below(after)))
        return -1;
    return NEXT("link", int (*)(const char *, const char *))(before, after);
}

static int is_lock(int command)
{
    return command == F_SETLK || command == F_SETLKW || command == F_GETLK;
}

int fcntl64(int descriptor, int command, ...)
{
    va_list arguments;
    va_start(arguments, command);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    if (is_lock(command) && fails(LOCK, is_file_below(descriptor)))
        return -1;
    return NEXT("fcntl64", int (*)(int, int, ...))(descriptor, command, argument);
}

int fcntl(int descriptor, int command, ...)
{
    va_list arguments;
    va_start(arguments, command);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    return fcntl64(descriptor, command, argument);
}
