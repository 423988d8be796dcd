// What the executable does where memory is short.
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

void thud_end_without_memory(size_t bytes);

// Ends the process with a sentence.
static void end(const char *sentence, size_t bytes)
{
   char text[160];

   snprintf(text, sizeof text, sentence, bytes);
   _exit(write(STDERR_FILENO, text, strlen(text)) < 0 ? 1 : 2);
}

void thud_end_without_memory(size_t bytes)
{
   end("thud: there is no memory for %zu bytes; allowed: fewer elements, modes or samples, or more memory\n", bytes);
}

// Before the libraries start: threads of OpenBLAS, which have no work here, take addresses that may be short, and where
// OpenBLAS finds none for itself it waits for ever.
static void begin(int count, char **arguments, char **environment)
{
   static char name[] = "OPENBLAS_NUM_THREADS=1";
   static const size_t libraries = 200000000;
   struct rlimit limit;
   int n = 0;

   if (count < 1 || getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return;
   if (limit.rlim_cur < libraries) end("thud: the libraries need %zu bytes of memory; allowed: more memory\n", libraries);
   for (; environment[n]; n++)
      if (strncmp(environment[n], name, strlen(name) - 1) == 0) return;

   char *longer[n + 2];

   memcpy(longer, environment, n*sizeof *longer);
   longer[n] = name;
   longer[n + 1] = NULL;
   execve("/proc/self/exe", arguments, longer);
}

__attribute__((section(".preinit_array"), used)) static void (*const first)(int, char **, char **) = begin;
