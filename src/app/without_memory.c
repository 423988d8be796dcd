// What the executable does where memory is short.
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

void thud_end_without_memory(size_t bytes);

// Threads of OpenBLAS, which are started as it is loaded and have no work here, take addresses that may be short.
__attribute__((constructor)) static void do_without_threads(int count, char **arguments)
{
   static const char name[] = "OPENBLAS_NUM_THREADS";
   struct rlimit limit;

   if (count < 1 || getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || getenv(name)) return;
   if (setenv(name, "1", 0) == 0) execv("/proc/self/exe", arguments);
}

// Ends the process with a sentence.
void thud_end_without_memory(size_t bytes)
{
   char text[160];

   snprintf(text, sizeof text, "thud: there is no memory for %zu bytes; allowed: fewer elements, modes or samples, or more "
      "memory\n", bytes);
   _exit(write(STDERR_FILENO, text, strlen(text)) < 0 ? 1 : 2);
}
