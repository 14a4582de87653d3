//! ECS glue.
