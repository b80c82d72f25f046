#ifndef GENU_CONTACT_THREADS_H
#define GENU_CONTACT_THREADS_H

/* A pool of threads for genu_workspace_set_task_runner (library genu_contact_threads, on oneTBB). C++: Threads.h. */

#include "genu/contact/genu_contact.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct genu_threads genu_threads;

/* num_threads: 1 to 1024, the caller's own included; 0: as many as the machine has. NULL when that is not allowed or no thread can
   be had. */
GENU_API genu_threads* genu_threads_create(int num_threads);
/* Not while a workspace still uses it. NULL is allowed. */
GENU_API void genu_threads_destroy(genu_threads* threads);
/* For any number of workspaces, also at the same time. */
GENU_API genu_task_runner genu_threads_runner(genu_threads* threads);

#ifdef __cplusplus
}
#endif

#endif
