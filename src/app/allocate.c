// Memory of the executable. The linker puts these allocations, those of any statement of Fortran, in the place of the
// system's.
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

void *__real_malloc(size_t bytes);
void *__real_calloc(size_t count, size_t bytes);
void *__real_realloc(void *before, size_t bytes);
void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t count, size_t bytes);
void *__wrap_realloc(void *before, size_t bytes);

// Threads of OpenBLAS, which are started as it is loaded and have no work here, take addresses that may be short.
__attribute__((constructor)) static void do_without_threads(int count, char **arguments)
{
   static const char name[] = "OPENBLAS_NUM_THREADS";
   struct rlimit limit;

   if (count < 1 || getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || getenv(name)) return;
   if (setenv(name, "1", 0) == 0) execv("/proc/self/exe", arguments);
}

// Ends the process with a sentence where there is no memory.
static void *require(void *place, size_t bytes)
{
   char text[160];

   if (place || bytes == 0) return place;
   snprintf(text, sizeof text, "thud: there is no memory for %zu bytes; allowed: fewer elements, modes or samples, or more "
      "memory\n", bytes);
   _exit(write(STDERR_FILENO, text, strlen(text)) < 0 ? 1 : 2);
}

void *__wrap_malloc(size_t bytes)
{
   return require(__real_malloc(bytes), bytes);
}

void *__wrap_calloc(size_t count, size_t bytes)
{
   return require(__real_calloc(count, bytes), count*bytes);
}

void *__wrap_realloc(void *before, size_t bytes)
{
   return require(__real_realloc(before, bytes), bytes);
}
